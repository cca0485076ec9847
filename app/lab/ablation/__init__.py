"""Ablations and baselines of a user's own capture: what each part of the method is worth there."""
