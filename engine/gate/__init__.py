"""Regions that a user marks, and why an anchor counts as static or dynamic."""
