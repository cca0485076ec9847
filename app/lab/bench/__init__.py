"""Measurements of the kernels: speed beside error. Numbers and text only; the command line prints."""
