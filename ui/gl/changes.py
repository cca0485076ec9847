"""Counts how often pictures that the window may show were replaced, so that equal frames need not be drawn twice."""

from __future__ import annotations

_count = 0  # of the whole program: textures are made in many places and shown in one window


def note_change() -> None:
    """The pixels of some texture are others now."""
    global _count
    _count += 1


def n_changes() -> int:
    """How often that happened since the program started."""
    return _count
