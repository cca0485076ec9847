"""Editing in the window: the selection, and edits of it."""
