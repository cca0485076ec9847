"""What the program knows and does."""
