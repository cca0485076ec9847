"""Depth maps of cameras: swept, slanted, smoothed, and checked by each other."""
