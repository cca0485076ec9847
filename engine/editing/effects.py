"""Effects: what a stack of edits does at one moment, without names and switches. Equal effects leave equal Gaussians:
they are part of the identity of a frame.
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
from msgspec import Struct

from engine.camera.camera_path import CameraPath
from engine.editing.actions import Action
from engine.editing.copies.object_copy import NO_COPIES, Copies, hiding_edits
from engine.editing.edit import Edit, ObjectTarget, TargetOfMoment, edits_at
from engine.editing.scene_object import Objects, at_moment, object_of


class Effect(Struct, frozen=True):
    """The effect of one edit where it holds. See Edit and Scope; its target is one of the moment, see `at_moment`."""

    target: TargetOfMoment
    action: Action
    is_inverted: bool = False
    is_reference_only: bool = False


@dataclass(frozen=True, slots=True)
class Effects:
    """The effects of a moment, in the order of the stack. A value; compared and hashed by what it does.

    Attributes:
        all: Each acts on what those before it have left.
        digest: The same for equal effects; empty where there are none.
    """

    all: tuple[Effect, ...] = ()
    digest: str = ""

    def __bool__(self) -> bool:
        return bool(self.all)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Effects) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @classmethod
    def of(cls, edits: tuple[Edit, ...], frame: float = 0.0, objects: Objects = ()) -> Effects:
        """Of edits that hold at a moment. frame: When; objects: Of the document."""
        return cls.made(
            Effect(at_moment(edit.target, frame, objects), edit.action, edit.is_inverted, edit.scope.is_reference_only)
            for edit in edits
        )

    @classmethod
    def made(cls, effects: Iterable[Effect]) -> Effects:
        """With the digest that belongs to them."""
        effects = tuple(effects)
        if not effects:
            return NO_EFFECTS
        return cls(effects, hashlib.sha256(_ENCODER.encode(effects)).hexdigest()[:20])


NO_EFFECTS = Effects()
_ENCODER = msgspec.msgpack.Encoder()


class EditStack:
    """The edits of a document, asked moment by moment: quick, as the window asks for every frame it may show next.

    Args:
        edits: In the order of the stack.
        objects: Of the document, for edits of objects.
        copies: Of the document; an object whose place one takes is hidden. See engine.editing.copies for what they add.
        paths: Of the document, which carry copies.
    """

    def __init__(
        self,
        edits: tuple[Edit, ...] = (),
        objects: Objects = (),
        copies: Copies = NO_COPIES,
        paths: tuple[CameraPath, ...] = (),
    ) -> None:
        self.edits, self.objects, self.copies, self.paths = edits, objects, copies, paths
        self._edits = edits = (*edits, *hiding_edits(copies))
        scopes = [edit.scope for edit in edits if edit.is_on]
        bounds = {scope.first for scope in scopes} | {scope.stop for scope in scopes if scope.stop is not None}
        for edit in edits:
            found = object_of(edit.target, objects) if isinstance(edit.target, ObjectTarget) else None
            bounds |= set() if found is None or not edit.is_on else found.bounds
        self._bounds = sorted(bounds - {0})
        self._effects: dict[int, Effects] = {}

    @property
    def parts(self) -> tuple[object, ...]:
        """Everything of the document that it is made of."""
        return self.edits, self.objects, self.copies, self.paths

    def at(self, frame: float, shown_by: int | None = None) -> Effects:
        """The effects that hold at a moment, in frames of the capture; between two frames that of the one before.

        Args:
            shown_by: A frame of the clip that shows the moment, where that is not the clip of the frame before: objects
                are other Gaussians there.
        """
        if shown_by is not None:
            return Effects.of(edits_at(self._edits, frame), shown_by, self.objects)
        place = bisect_right(self._bounds, math.floor(frame))
        if place not in self._effects:
            first = self._bounds[place - 1] if place else 0
            self._effects[place] = Effects.of(edits_at(self._edits, first), first, self.objects)
        return self._effects[place]
