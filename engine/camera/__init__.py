"""Calibrated cameras and the pinhole algebra."""
