"""Copies of objects in the panel of edits."""
