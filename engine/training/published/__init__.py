"""What the published method says, point by point, and what `--preset paper` does about it."""
