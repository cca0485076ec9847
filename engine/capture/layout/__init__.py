"""What readers of formats return, and the checks that they share."""
