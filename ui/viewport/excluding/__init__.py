"""Painting over a camera's picture: the brush, and the hatching of the painted part."""
