"""Editing in the window: what is selected, and what becomes of it."""
