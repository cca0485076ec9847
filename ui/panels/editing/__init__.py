"""Panels and pointer of what is edited."""
