"""Cost of training the next clips."""
