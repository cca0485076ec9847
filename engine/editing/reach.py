"""In which frames an edit can act: where its scope meets clips that have its target."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from engine.clip_files.roles import REFERENCE_ROLES, STATIC
from engine.editing.edit import Edit, ObjectTarget, Picked, Scope, Target
from engine.editing.gaussian_rows import RowSet
from engine.editing.picks import n_rows
from engine.editing.scene_object import NO_OBJECTS, Objects, SceneObject, object_of

Frames = tuple[tuple[int, int], ...]
"""Runs of frames, as first ones and those after the last."""


@dataclass(frozen=True, slots=True)
class ClipAnchors:
    """Which anchors a clip has, by the names that edits give them.

    Attributes:
        clip_index: Of the clip.
        start, stop: Its first frame, and the one after its last.
        origin: Of its own anchors, see ClipHeader.origin; empty of a clip that is not trained.
        inherits: Origin of those that it inherits, or will inherit; empty where it has its own only.
    """

    clip_index: int
    start: int
    stop: int
    origin: str = ""
    inherits: str = ""

    def holds(self, row_set: RowSet, *, is_reference_only: bool = False) -> bool:
        """Whether some of its anchors are these. is_reference_only: See Scope."""
        if self.inherits and row_set.origin == self.inherits:
            return row_set.role in REFERENCE_ROLES
        return bool(self.origin) and row_set.origin == self.origin and not (is_reference_only and self.inherits)


@dataclass(frozen=True, slots=True)
class Reach:
    """Where an edit acts. Without known clips nothing is known, and everything is empty.

    Attributes:
        acts: Frames of its scope in which its target exists.
        is_whole: Whether these are all frames of its scope.
        exists: All frames in which there is something that it would act on, whatever its scope.
        n_picked: Gaussians that were picked; 0 where it acts on a volume or on everything.
        n_ending: Of these, those that are missing in some frames of the scope.
        ending: Frames in which those are.
        empty: Of an inverted selection, frames of the scope in which nothing of it is, so that everything is meant.
        has_newcomers: Whether the selection moves, and the scope has clips that show what moves by Gaussians of their
            own as well, which are not in it.
    """

    acts: Frames = ()
    is_whole: bool = True
    exists: Frames = ()
    n_picked: int = 0
    n_ending: int = 0
    ending: Frames = ()
    empty: Frames = ()
    has_newcomers: bool = False

    @property
    def is_nowhere(self) -> bool:
        """Whether it can act in no frame, although its target is known."""
        return bool(self.exists) and not self.acts


UNKNOWN = Reach()


def reach_of_edit(edit: Edit, clips: Iterable[ClipAnchors], objects: Objects = NO_OBJECTS) -> Reach:
    """Where an edit acts. Raises ValueError where picked numbers are damaged. objects: Of the document."""
    if isinstance(edit.target, ObjectTarget):
        return _reach_of_object(object_of(edit.target, objects), edit, tuple(clips))
    return reach_of(sets_of(edit.target), edit.scope, clips, is_inverted=edit.is_inverted)


def sets_of(target: Target) -> tuple[tuple[RowSet, int], ...]:
    """Picked anchor sets with the number of Gaussians of each; none of a volume or of everything."""
    if not isinstance(target, Picked):
        return ()
    return tuple((RowSet(one.origin, one.clip_index, one.role), n_rows(one.rows)) for one in target.sets)


def reach_of(
    picked: Sequence[tuple[RowSet, int]], scope: Scope, clips: Iterable[ClipAnchors], *, is_inverted: bool = False
) -> Reach:
    """Find out where an edit acts.

    Args:
        picked: See `sets_of`.
        is_inverted: Whether it acts on everything but the target.
        clips: All clips, in their order.
    """
    clips = tuple(clips)
    within = [clip for clip in clips if scope.touches(clip.start, clip.stop)]
    if not picked:
        return Reach(_runs(within, scope), exists=_runs(clips))
    having = {row_set: [clip for clip in clips if clip.holds(row_set)] for row_set, _ in picked}
    known = [clip for clip in clips if any(clip in found for found in having.values())]
    if not known:  # lost, or of a clip that is being trained
        return UNKNOWN
    n_picked = sum(n for _, n in picked)
    if is_inverted:
        empty = _runs([clip for clip in within if clip not in known], scope)
        return Reach(_runs(within, scope), exists=_runs(clips), n_picked=n_picked, empty=empty)

    def acting(clip: ClipAnchors, row_set: RowSet) -> bool:
        return clip.holds(row_set, is_reference_only=scope.is_reference_only)

    acts = [clip for clip in within if any(acting(clip, row_set) for row_set, _ in picked)]
    ending = [(row_set, n) for row_set, n in picked if not all(acting(clip, row_set) for clip in within)]
    where = [clip for clip in clips if any(clip in having[row_set] for row_set, _ in ending)]
    moving = {row_set.origin for row_set, _ in picked if row_set.role != STATIC}
    others = [clip for clip in within if clip.inherits and clip.origin not in moving]
    return Reach(
        _runs(acts, scope),
        is_whole=len(acts) == len(within),
        exists=_runs(known),
        n_picked=n_picked,
        n_ending=sum(n for _, n in ending),
        ending=_runs(where),
        has_newcomers=bool(moving and others) and not scope.is_reference_only,
    )


def unsearched(one: SceneObject, clips: Iterable[ClipAnchors]) -> tuple[ClipAnchors, ...]:
    """The trained clips in which nobody has looked for an object since it was corrected, or they were trained."""
    known = {(clip.start, clip.stop): clip.origin for clip in one.clips}
    return tuple(clip for clip in clips if clip.origin and known.get((clip.start, clip.stop)) != clip.origin)


def _reach_of_object(found: SceneObject | None, edit: Edit, clips: Sequence[ClipAnchors]) -> Reach:
    """Of an edit of an object: it acts where the object was found, an inverted one everywhere."""
    if found is None:
        return UNKNOWN
    there = {(clip.start, clip.stop) for clip in found.clips if clip.sets}
    having = [clip for clip in clips if (clip.start, clip.stop) in there]
    within = [clip for clip in clips if edit.scope.touches(clip.start, clip.stop)]
    acts = within if edit.is_inverted else [clip for clip in within if clip in having]
    exists = clips if edit.is_inverted else having
    return Reach(_runs(acts, edit.scope), exists=_runs(exists))


def _runs(clips: Sequence[ClipAnchors], scope: Scope | None = None) -> Frames:
    """The frames of clips that belong to a scope, clips that follow each other in one run."""
    runs: list[tuple[int, int]] = []
    for clip in clips:
        first = clip.start if scope is None else max(clip.start, scope.first)
        stop = clip.stop if scope is None or scope.stop is None else min(clip.stop, scope.stop)
        if runs and runs[-1][1] == first:
            runs[-1] = (runs[-1][0], stop)
        else:
            runs.append((first, stop))
    return tuple(runs)
