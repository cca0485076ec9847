"""Figures that the lab adds to an evaluation: tOF and LPIPS."""
