"""Pixels and input."""
