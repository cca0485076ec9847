"""Copies of objects: the same person or thing again, somewhere else, at another time or another speed."""
