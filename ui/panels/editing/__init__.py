"""Panels and pointer for editing."""
