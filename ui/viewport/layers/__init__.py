"""What is drawn over the picture, one layer per thing."""
