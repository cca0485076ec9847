"""Edits of a trained scene that hold over time: what they act on, what they do, and the Gaussians that come of it."""
