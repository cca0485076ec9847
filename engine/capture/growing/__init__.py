"""Captures that are still being recorded: reading them, and seeing them grow."""
