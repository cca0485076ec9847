"""Objects in words: where they are, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable

from app.document.changes.reach_words import frames_text
from engine.editing.reach import Frames
from engine.editing.scene_object import Doubt, ObjectInClip, SceneObject

DOUBT_WORDS: dict[Doubt, str] = {
    "touching": "touches something else that moves",
    "returning": "was away, and something like it has come",
    "resting": "does not move",
    "gone": "nothing of it is there",
}
SURE = 0.5
"""Least confidence of what nobody need look at."""


def doubt_text(clip: ObjectInClip) -> str:
    """Why it is uncertain where an object is in a clip; empty where it is not."""
    return DOUBT_WORDS.get(clip.doubt, "")


def is_doubtful(clip: ObjectInClip) -> bool:
    """Whether somebody should look at an object in a clip. That it is gone is not a doubt where that is sure."""
    return clip.confidence < SURE or clip.doubt in ("touching", "returning")


def runs_within(one: SceneObject, runs: Iterable[tuple[int, int]]) -> Frames:
    """Runs of frames, as far as the object exists in them; those that follow each other as one."""
    found: list[tuple[int, int]] = []
    for first, stop in runs:
        first, stop = max(first, one.first), stop if one.stop is None else min(stop, one.stop)
        if first >= stop:
            continue
        if found and found[-1][1] == first:
            found[-1] = (found[-1][0], stop)
        else:
            found.append((first, stop))
    return tuple(found)


def seen_text(one: SceneObject) -> str:
    """In which frames an object is: "frames 0-9 and 20-29"."""
    runs = runs_within(one, (run for clip in one.clips for run in clip.seen))
    return frames_text(runs) if runs else "in no frame"


def confidence_text(one: SceneObject) -> str:
    """How sure it is where an object is: "sure", "doubtful in frames 10-19"."""
    doubtful = runs_within(one, ((clip.start, clip.stop) for clip in one.clips if clip.origin and is_doubtful(clip)))
    if not any(clip.origin for clip in one.clips):
        return ""
    return f"doubtful in {frames_text(doubtful)}" if doubtful else "sure"
