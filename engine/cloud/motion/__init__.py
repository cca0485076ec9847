"""What moves as points: visual hulls of all frames."""
