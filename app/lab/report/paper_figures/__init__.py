"""Figures and tables of the paper: projects side by side at the same place, and over lengths of clips and sequences."""
