"""Exports: Gaussians as files of other programs, as plain arrays."""
