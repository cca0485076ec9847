"""The published method, point by point, and how `--preset paper` follows it."""
