"""What of the capture training never sees, as a user deals with it."""
