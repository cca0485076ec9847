"""Figures of the paper: projects beside each other at the same place, and over the length of clips and sequences."""
