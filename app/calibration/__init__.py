"""Calibrating a folder of plain videos, as the program does it: a job with progress that leaves a capture."""
