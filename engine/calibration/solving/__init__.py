"""Cameras from matches: first estimates, adjustment, and what does not fit."""
