"""The worker's side of a training: the loop around it, and its files in the store."""
