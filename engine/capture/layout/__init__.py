"""The results that readers of formats return, and the checks that they share."""
