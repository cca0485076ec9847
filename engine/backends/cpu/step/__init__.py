"""Kernels of a training step behind the picture: loss, squares of tiles, volume term and Adam."""
