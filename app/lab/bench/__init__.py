"""Measurements of the kernels: speed next to error. Numbers and text only; the command line prints."""
