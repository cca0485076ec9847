"""Editing over the picture: the tools that select, and how the selection shows."""
