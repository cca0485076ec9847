"""Cameras of a capture, as the files of other programs describe them."""
