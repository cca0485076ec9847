"""Frames as one file of Gaussians over time."""
