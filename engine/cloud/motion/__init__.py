"""The moving parts as points: visual hulls of all frames."""
