"""Words that findings share."""

from __future__ import annotations

from collections.abc import Sequence

_LISTED = 6


def listed(items: Sequence[object]) -> str:
    """Names or numbers in a sentence; of many the first ones."""
    texts = [str(item) for item in items]
    if len(texts) > _LISTED:
        return f"{', '.join(texts[:_LISTED])} and {len(texts) - _LISTED} more"
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def counted(items: Sequence[object], one: str, several: str) -> str:
    """The word for one or for several."""
    return one if len(items) == 1 else several


def spans(frames: Sequence[int]) -> str:
    """Rising frame indices as runs: "3, 7 to 9"."""
    runs: list[list[int]] = []
    for frame in frames:
        if runs and frame == runs[-1][1] + 1:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    return listed([f"{first}" if first == last else f"{first} to {last}" for first, last in runs])
