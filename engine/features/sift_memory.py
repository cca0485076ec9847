"""How much memory key points take while they are looked for, and how many pictures fit into it at once."""

from __future__ import annotations

from engine.parallel import n_cores

MAX_SIDE_PX = 1280
"""Larger pictures are matched smaller: SIFT on full HD takes minutes, and its users need no more."""
BYTES_PER_PIXEL = 300
"""SIFT doubles a picture and keeps some twenty smoothed copies of it as float32. Measured: 285."""


def sift_bytes(width: int, height: int) -> int:
    """The memory of one picture."""
    ratio = min(1.0, MAX_SIDE_PX / max(width, height))
    return int(width * ratio * height * ratio) * BYTES_PER_PIXEL


def n_at_once(width: int, height: int, max_bytes: int) -> int:
    """How many pictures may be worked on side by side: one at least, and no more than there are cores."""
    return min(max(max_bytes // max(sift_bytes(width, height), 1), 1), n_cores())
