"""The row of boxes over the picture."""
