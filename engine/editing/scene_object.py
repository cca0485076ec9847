"""SceneObject: a person or a thing, selected once and found again in every clip. Plain values that travel as JSON.

A clip's Gaussians are its own, so that an object is other Gaussians in each clip; which ones is worked out by
engine.objects from what somebody has selected, and kept here: an edit of an object needs no search.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from engine.editing.actions import Vector
from engine.editing.edit import MAX_NAME_CHARACTERS, ObjectTarget, Picked, PickedRows

_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Name = Annotated[str, Meta(min_length=1, max_length=MAX_NAME_CHARACTERS)]

Doubt = Literal["", "touching", "returning", "resting", "gone"]
"""Why it is uncertain where an object is in a clip: it touches something else that moves, it was away and something
like it has come, it does not move, or nothing of it is there."""


class ObjectSeed(Struct, frozen=True, forbid_unknown_fields=True):
    """What somebody has said of an object in one frame: the first seed makes it, later ones correct it.

    Attributes:
        frame_index: The frame that was looked at.
        added: Gaussians that belong to it.
        removed: Gaussians that do not.
    """

    frame_index: _Count
    added: tuple[PickedRows, ...] = ()
    removed: tuple[PickedRows, ...] = ()


class ObjectInClip(Struct, frozen=True, forbid_unknown_fields=True):
    """An object in one clip.

    Attributes:
        start, stop: First frame of the clip, and the one after its last.
        sets: Its Gaussians in this clip, whatever they do over time; empty where it is not there.
        seen: Runs of frames in which it is there, as first ones and those after the last.
        confidence: How sure that is, 0 to 1.
        doubt: Why it is not sure.
        origin: Of the clip that was searched, see ClipHeader.origin; where the clip has another one now, and where this
            is empty, it has to be searched yet.

    Raises:
        ValueError: There is no frame in it.
    """

    start: _Count
    stop: _Count
    sets: tuple[PickedRows, ...] = ()
    seen: tuple[tuple[_Count, _Count], ...] = ()
    confidence: _Share = 1.0
    doubt: Doubt = ""
    origin: str = ""

    def __post_init__(self) -> None:
        if self.stop <= self.start:
            raise ValueError(f"a clip from frame {self.start} up to {self.stop} holds no frame")


class SceneObject(Struct, frozen=True, forbid_unknown_fields=True):
    """An object of the scene.

    Attributes:
        object_id: Names it for good; no two objects of a document have the same.
        name: For people; no two objects have the same.
        color: In which it is outlined and drawn on the timeline, RGB in 0..1.
        seeds: What somebody has said of it, in that order.
        clips: Where it was found, by frame; clips that are missing have not been looked at.
        first: The first frame in which it is an object.
        stop: One after the last; None for all that follow.
        is_trained: Whether clips that are trained from now on see it.

    Raises:
        ValueError: There is no frame in it.
    """

    object_id: _Count
    name: _Name
    color: Vector = (1.0, 0.6, 0.1)
    seeds: tuple[ObjectSeed, ...] = ()
    clips: tuple[ObjectInClip, ...] = ()
    first: _Count = 0
    stop: _Count | None = None
    is_trained: bool = True

    def __post_init__(self) -> None:
        if self.stop is not None and self.stop <= self.first:
            raise ValueError(f"an object from frame {self.first} up to {self.stop} has no frame")

    def in_clip(self, frame: float) -> ObjectInClip | None:
        """Where it was found in the clip of a moment; None where nobody has looked, or the object does not exist."""
        if frame < self.first or (self.stop is not None and frame >= self.stop):
            return None
        return next((clip for clip in self.clips if clip.start <= frame < clip.stop), None)

    def picked(self, frame: float) -> Picked:
        """Its Gaussians at a moment, of the clip that shows it."""
        found = self.in_clip(frame)
        return Picked(() if found is None else found.sets)

    def is_seen(self, frame: float) -> bool:
        """Whether it was found at a moment."""
        found = self.in_clip(frame)
        return found is not None and any(first <= frame < stop for first, stop in found.seen)

    @property
    def bounds(self) -> set[int]:
        """Frames from which on other Gaussians are it."""
        found = {self.first, *(() if self.stop is None else (self.stop,))}
        for clip in self.clips:
            found |= {clip.start, clip.stop}
        return found


Objects = tuple[SceneObject, ...]
NO_OBJECTS: Objects = ()


def object_of(target: ObjectTarget, objects: Objects) -> SceneObject | None:
    """The object that a target means; None where it was removed."""
    return next((one for one in objects if one.object_id == target.object_id), None)
