"""The worker's side of a training: the loop around it, and what that leaves in the store."""
