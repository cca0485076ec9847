"""COLMAP's output: cameras, images and points of a sparse model, as binary files or as text."""
