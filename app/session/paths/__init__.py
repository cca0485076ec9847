"""Camera paths: commands, and what they make of the paths."""
