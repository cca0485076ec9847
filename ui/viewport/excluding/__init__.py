"""Painting over what a camera took: the brush, and the hatching of what is painted."""
