"""Clips of Gaussians that other programs made."""
