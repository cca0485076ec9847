"""Frames as files of Gaussians, read back and compared."""
