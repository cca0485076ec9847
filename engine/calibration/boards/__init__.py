"""Calibration by a board of known size that all cameras film."""
