"""Mending a seam: making the jump between two clips smaller than it was trained to be."""
