"""Captures on disk, read lazily."""
