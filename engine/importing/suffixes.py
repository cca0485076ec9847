"""Ends of the names of scenes that can be imported. Plain values, for whoever asks before anything is read."""

from __future__ import annotations

from pathlib import Path

FRAME_SUFFIXES = (".ply", ".spz", ".splat", ".sog")
"""Of files that hold one frame; those of .compressed.ply are among them."""
SEQUENCE_SUFFIXES = (".4dgs", ".tsog")
"""Of files over time. USD is only written: a stage opens whatever other files it names, and a damaged one takes memory
without a bound."""


def is_scene_file(path: Path) -> bool:
    """Whether this is a file whose name says that it holds a scene."""
    try:
        return path.suffix.lower() in (*FRAME_SUFFIXES, *SEQUENCE_SUFFIXES) and path.is_file()
    except OSError:
        return False
