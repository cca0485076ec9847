"""Frames as runs without gaps."""

from __future__ import annotations

from collections.abc import Iterable


def runs_of(frames: Iterable[int]) -> list[range]:
    """Rising frames as runs without gaps."""
    runs: list[range] = []
    for frame in frames:
        if runs and runs[-1].stop == frame:
            runs[-1] = range(runs[-1].start, frame + 1)
        else:
            runs.append(range(frame, frame + 1))
    return runs
