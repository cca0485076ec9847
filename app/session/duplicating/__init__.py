"""Copies of objects: commands, and what they make of a document."""
