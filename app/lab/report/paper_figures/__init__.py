"""Figures of the paper: projects side by side at the same place, and over the length of clips and sequences."""
