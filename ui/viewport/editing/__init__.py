"""Editing over the picture: the tools that select, and how what is selected shows."""
