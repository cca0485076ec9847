"""The frames of a new edit, as the user chooses them, and how many clips and frames that is."""

from __future__ import annotations

from typing import Literal, get_args

from app.playback.timeline import Timeline
from engine.editing.edit import Scope

ScopeChoice = Literal["everywhere", "frame", "range", "clip", "onward", "reference"]
SCOPE_CHOICES: tuple[ScopeChoice, ...] = get_args(ScopeChoice)
SCOPE_WORDS: dict[ScopeChoice, str] = {
    "everywhere": "everywhere",
    "frame": "this frame",
    "range": "in to out",
    "clip": "this clip",
    "onward": "from here on",
    "reference": "the reference",
}


def chosen_scope(choice: ScopeChoice, timeline: Timeline) -> Scope:
    """The frames that a choice stands for at the playhead; without a range, in to out is the whole capture."""
    frame, clip = timeline.frame_index, timeline.clip
    match choice:
        case "everywhere":
            return Scope()
        case "frame":
            return Scope(frame, frame + 1)
        case "range":
            if timeline.in_frame is None and timeline.out_frame is None:
                return Scope()
            out = timeline.last_frame if timeline.out_frame is None else timeline.out_frame
            return Scope(timeline.in_frame or 0, out + 1)
        case "clip":
            return Scope() if clip is None else Scope(clip.start, clip.stop)
        case "onward":
            return Scope(frame)
        case "reference":
            return Scope(is_reference_only=True)


def choice_of(scope: Scope, timeline: Timeline) -> ScopeChoice | None:
    """The choice that stands for a scope at the playhead; None where none does."""
    return next((choice for choice in SCOPE_CHOICES if chosen_scope(choice, timeline) == scope), None)


def extent_of(scope: Scope, timeline: Timeline) -> tuple[int, int]:
    """How many clips and frames of the capture a scope holds."""
    stop = timeline.n_frames if scope.stop is None else min(scope.stop, timeline.n_frames)
    n_clips = sum(scope.touches(clip.start, clip.stop) for clip in timeline.clips)
    return n_clips, max(stop - scope.first, 0)


def extent_text(scope: Scope, timeline: Timeline) -> str:
    """Clips and frames of a new edit of this scope, in words."""
    n_clips, n_frames = extent_of(scope, timeline)
    return f"{_counted(n_frames, 'frame')} in {_counted(n_clips, 'clip')}"


def _counted(n: int, word: str) -> str:
    return f"{n:,} {word}{'' if n == 1 else 's'}"
