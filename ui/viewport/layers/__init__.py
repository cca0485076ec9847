"""Layers drawn over the picture, one per thing."""
