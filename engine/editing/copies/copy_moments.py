"""CopyMoments: what the copies of a document are made of, moment by moment. Values; nothing here decodes.

They name Gaussians of other moments, and are part of the identity of a frame by their digest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import msgspec
import numpy as np

from engine.camera.camera_path import CameraPath
from engine.camera.rotations import quats_of
from engine.editing.actions import FAR, Transform
from engine.editing.copies.object_copy import NO_COPIES, ObjectCopy, OnObject, OnPath, nearest_frame, span_of
from engine.editing.edit import Picked
from engine.editing.effects import EditStack, Effects
from engine.editing.scene_object import SceneObject

MAX_KEPT = 4096
"""Moments that are kept."""


@dataclass(frozen=True, slots=True)
class ObjectMoment:
    """An object at a moment.

    Attributes:
        picked: Its Gaussians then.
        frame: When, in frames of the capture, between frames too.
        effects: Of the edits that hold then.
    """

    picked: Picked
    frame: float
    effects: Effects

    @property
    def digest(self) -> str:
        """The same for equal ones."""
        return f"{_picked_digest(self.picked)} {self.frame!r} {self.effects.digest}"


@dataclass(frozen=True, slots=True)
class CopyOfMoment:
    """A copy at a moment.

    Attributes:
        source: What is copied.
        moves: Where that goes, one after another.
        follows: An object at rest and now: the copy is moved as the middle of it has moved.
    """

    source: ObjectMoment
    moves: tuple[Transform, ...]
    follows: tuple[ObjectMoment, ObjectMoment] | None = None


@dataclass(frozen=True, slots=True)
class FrameCopies:
    """All copies of a moment. A value; compared and hashed by what it does.

    Attributes:
        all: In the order of the document.
        digest: The same for equal ones; empty where there are none.
        frames: Frames whose clips are needed, each once.
    """

    all: tuple[CopyOfMoment, ...] = ()
    digest: str = ""
    frames: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.all)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrameCopies) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


NOTHING_COPIED = FrameCopies()


class CopyMoments:
    """The copies of a document, asked moment by moment. For one thread; answers are kept.

    Args:
        stack: With the copies, and what they copy and are carried by.
    """

    def __init__(self, stack: EditStack) -> None:
        self.stack = stack
        self._of_objects = EditStack(stack.edits, stack.objects)  # an object that is not shown has copies all the same
        self._objects = {one.object_id: one for one in stack.objects}
        self._paths = {path.name: path for path in stack.paths if path.keys}
        self._kept: dict[float, FrameCopies] = {}

    def at(self, frame: float) -> FrameCopies:
        """The copies of a moment, in frames of the capture, between frames too."""
        if self.stack.copies is NO_COPIES or not self.stack.copies:
            return NOTHING_COPIED
        if frame not in self._kept:
            if len(self._kept) >= MAX_KEPT:
                self._kept.clear()
            self._kept[frame] = _made(tuple(self._all(frame)))
        return self._kept[frame]

    def _all(self, frame: float) -> Iterator[CopyOfMoment]:
        for copy in self.stack.copies:
            source = self._source(copy, frame) if copy.holds_at(frame) else None
            if source is not None:
                yield CopyOfMoment(source, (copy.transform, *self._on_path(copy, frame)), self._followed(copy, frame))

    def _source(self, copy: ObjectCopy, frame: float) -> ObjectMoment | None:
        found = self._objects.get(copy.object_id)
        span = None if found is None else span_of(found)
        moment = None if span is None else copy.source_frame(frame, span)
        return None if found is None or moment is None else self._moment(found, moment)

    def _moment(self, found: SceneObject, frame: float) -> ObjectMoment | None:
        """An object at a moment; None where it is not there. Its clip is that of the nearest frame."""
        shown = nearest_frame(frame)
        picked = found.picked(shown)
        return ObjectMoment(picked, float(frame), self._of_objects.at(shown)) if picked.sets else None

    def _on_path(self, copy: ObjectCopy, frame: float) -> Iterator[Transform]:
        """How the camera of a path has moved since the copy was where its transform says."""
        if not isinstance(copy.carried_by, OnPath) or copy.carried_by.name not in self._paths:
            return
        path = self._paths[copy.carried_by.name]
        yield moved_along(path, copy.anchor_frame, frame)

    def _followed(self, copy: ObjectCopy, frame: float) -> tuple[ObjectMoment, ObjectMoment] | None:
        if not isinstance(copy.carried_by, OnObject) or copy.carried_by.object_id not in self._objects:
            return None
        found = self._objects[copy.carried_by.object_id]
        span = span_of(found)
        if span is None:
            return None
        first, stop = span
        rest, now = (self._moment(found, min(max(at, first), stop - 1.0)) for at in (copy.anchor_frame, frame))
        return None if rest is None or now is None else (rest, now)


def moved_along(path: CameraPath, rest: float, now: float) -> Transform:
    """How the camera of a path moves from one moment to another, as a rotation about the origin and a movement."""
    (before, after), _ = path.poses(np.array([rest, now]))
    motion = np.linalg.inv(after) @ before  # points are where they were in the camera
    quat = quats_of(motion[:3, :3])
    translation = np.clip(motion[:3, 3], -FAR, FAR)
    return Transform(tuple(map(float, translation)), tuple(map(float, quat)))  # pyright: ignore[reportArgumentType]


def _made(copies: tuple[CopyOfMoment, ...]) -> FrameCopies:
    if not copies:
        return NOTHING_COPIED
    digest = hashlib.sha256()
    for copy in copies:
        digest.update(copy.source.digest.encode())
        digest.update(_ENCODER.encode(copy.moves))
        digest.update(repr(None if copy.follows is None else [one.digest for one in copy.follows]).encode())
    moments = (one for copy in copies for one in (copy.source, *(copy.follows or ())))
    frames = dict.fromkeys(nearest_frame(one.frame) for one in moments)
    return FrameCopies(copies, digest.hexdigest()[:20], tuple(frames))


_ENCODER = msgspec.msgpack.Encoder()


@lru_cache(maxsize=4096)
def _picked_digest(picked: Picked) -> str:
    return hashlib.sha256(_ENCODER.encode(picked)).hexdigest()[:20]
