"""Arithmetic on pictures that clouds, training and figures share."""
