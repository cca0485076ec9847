"""Filling what was behind the things that edits of a project take away."""
