"""Camera paths: commands and their results."""
