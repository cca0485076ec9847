"""ObjectCopy: an object shown once more, elsewhere and at another time. Plain values that travel as JSON.

A copy adds Gaussians to what is shown and changes nothing that was trained: it follows the object, and the edits of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from msgspec import Meta, Struct

from engine.editing.actions import Hide, Transform
from engine.editing.edit import MAX_NAME_CHARACTERS, Edit, ObjectTarget, Scope
from engine.editing.scene_object import SceneObject

MAX_COPIES = 1000
MAX_SPEED = 100.0
MAX_FRAMES = 1e9
"""Largest shift in time, frames."""
_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Name = Annotated[str, Meta(min_length=1, max_length=MAX_NAME_CHARACTERS)]

Outside = Literal["hold", "loop", "gone"]
"""What a copy does at a time when its object does not exist: it stands as in the nearest frame in which it does, it
begins again, or it is not there."""


class OnPath(Struct, frozen=True, forbid_unknown_fields=True, tag="path"):
    """Carried by a camera path, as if fixed to its camera. name: Of the path; one that was removed carries nothing."""

    name: _Name


class OnObject(Struct, frozen=True, forbid_unknown_fields=True, tag="object"):
    """Carried along by another object, not turned. object_id: Of it; one that was removed carries nothing."""

    object_id: _Count


class ObjectCopy(Struct, frozen=True, forbid_unknown_fields=True):
    """A copy of an object.

    Attributes:
        copy_id: Names it for good; no two copies of a document have the same.
        name: For people.
        object_id: Of the object; a copy of one that was removed is not there.
        transform: Where it is, compared with the object.
        shift_frames: So much later than the object it does everything; earlier where negative.
        speed: How many frames of the object pass in a frame; 0 stands still, negative ones go backward.
        anchor_frame: The frame at which a copy of any speed does what one of speed 1 does, and at which a copy that is
            carried is where its transform says.
        outside: What it does when its object does not exist.
        is_in_place: Whether it takes the place of the object, which is not shown then.
        carried_by: What carries it.
        first: The first frame in which it is there.
        stop: One after the last; None for all that follow.
        group: Name of the copies that it was made with; empty for one alone.
        is_on: Whether it counts now.

    Raises:
        ValueError: A number is not finite or out of range, or there is no frame in it.
    """

    copy_id: _Count
    name: _Name
    object_id: _Count
    transform: Transform = Transform()
    shift_frames: float = 0.0
    speed: float = 1.0
    anchor_frame: float = 0.0
    outside: Outside = "hold"
    is_in_place: bool = False
    carried_by: OnPath | OnObject | None = None
    first: _Count = 0
    stop: _Count | None = None
    group: Annotated[str, Meta(max_length=MAX_NAME_CHARACTERS)] = ""
    is_on: bool = True

    def __post_init__(self) -> None:
        for words, number, most in (
            ("shift", self.shift_frames, MAX_FRAMES),
            ("speed", self.speed, MAX_SPEED),
            ("anchor frame", self.anchor_frame, MAX_FRAMES),
        ):
            if not abs(number) <= most:  # which a number that is not finite isn't, either
                raise ValueError(f"the {words} {number:g} of a copy is not from {-most:g} to {most:g}")
        if self.stop is not None and self.stop <= self.first:
            raise ValueError(f"a copy from frame {self.first} up to {self.stop} has no frame")

    def holds_at(self, frame: float) -> bool:
        """Whether it is there at a moment, as far as its own frames and switch say."""
        return self.is_on and Scope(self.first, self.stop).holds_at(frame)

    def source_frame(self, frame: float, span: tuple[int, int]) -> float | None:
        """When the object does what the copy does at a moment; between frames, too. None where it is not there.

        Args:
            frame: In frames of the capture.
            span: The first frame in which the object exists, and the one after the last.
        """
        wanted = self.anchor_frame + self.speed * (frame - self.anchor_frame) - self.shift_frames
        first, stop = span
        if self.outside == "loop":
            wanted = first + (wanted - first) % (stop - first)
        elif self.outside == "gone" and not first <= wanted < stop:
            return None
        return min(max(wanted, float(first)), stop - 1.0)


Copies = tuple[ObjectCopy, ...]
NO_COPIES: Copies = ()


def span_of(found: SceneObject) -> tuple[int, int] | None:
    """The first frame in which an object was found, and the one after the last; None where it was found nowhere."""
    runs = [run for clip in found.clips if clip.sets for run in (clip.seen or ((clip.start, clip.stop),))]
    if not runs:
        return None
    stops = [max(stop for _, stop in runs), *(() if found.stop is None else (found.stop,))]
    first, stop = max(min(first for first, _ in runs), found.first), min(stops)
    return (first, stop) if first < stop else None


def hiding_edits(copies: Copies) -> Iterator[Edit]:
    """What hides the objects whose place copies take."""
    for copy in copies:
        if copy.is_on and copy.is_in_place:
            scope = Scope(copy.first, copy.stop)
            yield Edit(copy.copy_id, copy.name, ObjectTarget(copy.object_id), Hide(), scope)


def nearest_frame(moment: float) -> int:
    """The frame whose clip shows a moment: the nearest one, the earlier one half way."""
    return math.ceil(moment - 0.5)
