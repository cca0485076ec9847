"""Exports that wait, run in a process and have ended."""
