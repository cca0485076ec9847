"""SceneObject: a person or a thing, selected once and found again in every clip. Plain values that travel as JSON.

A clip's Gaussians are its own, so that an object is other Gaussians in each clip; which ones is worked out by
engine.objects from what somebody has selected, and kept here: an edit of an object needs no search.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

from engine.editing.actions import Vector
from engine.editing.edit import MAX_NAME_CHARACTERS, ObjectTarget, Picked, PickedRows
from engine.editing.selection.seen_from import SeenFrom

MAX_VIEW_PX = 1 << 16
_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Name = Annotated[str, Meta(min_length=1, max_length=MAX_NAME_CHARACTERS)]

Doubt = Literal["", "touching", "returning", "resting", "gone"]
"""Why it is uncertain where an object is in a clip: it touches something else that moves, it was away and something
like it has come, it does not move, or nothing of it is there."""


class SeedView(Struct, frozen=True, forbid_unknown_fields=True):
    """The picture in which something was selected; see engine.editing.selection.seen_from.SeenFrom.

    Attributes:
        world_to_camera: Rigid map, OpenCV axes, row by row. [4, 4]
        K: Intrinsics in pixels, row by row. [3, 3]
        width, height: Of the picture, px.
        near, set_back: See SeenFrom.

    Raises:
        ValueError: These numbers are not a view.
    """

    world_to_camera: tuple[float, ...]
    K: tuple[float, ...]
    width: int
    height: int
    near: float
    set_back: float = 0.0

    def __post_init__(self) -> None:
        if len(self.world_to_camera) != 16 or len(self.K) != 9 or max(self.width, self.height) > MAX_VIEW_PX:
            raise ValueError("a view has a pose of 16 numbers, intrinsics of 9, and fewer pixels a side than 2^16")
        self.view()

    @classmethod
    def of(cls, view: SeenFrom) -> SeedView:
        """As plain numbers."""
        pose, K = (tuple(float(number) for number in np.ravel(m)) for m in (view.world_to_camera, view.K))
        return cls(pose, K, view.width, view.height, view.near, view.set_back)

    def view(self) -> SeenFrom:
        """To project with."""
        pose, K = np.reshape(self.world_to_camera, (4, 4)), np.reshape(self.K, (3, 3))
        return SeenFrom(pose, K, self.width, self.height, self.near, self.set_back)


class ObjectSeed(Struct, frozen=True, forbid_unknown_fields=True):
    """What somebody has said of an object in one frame: the first seed makes it, later ones correct it.

    Attributes:
        frame_index: The frame that was looked at.
        added: Gaussians that belong to it.
        removed: Gaussians that do not.
        view: The picture in which they were selected: what could not be seen in it was not meant. None where all of
            them are meant, as for a box.
    """

    frame_index: _Count
    added: tuple[PickedRows, ...] = ()
    removed: tuple[PickedRows, ...] = ()
    view: SeedView | None = None


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
