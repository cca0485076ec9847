"""Effects: what a stack of edits does at one moment, without names and switches. Equal effects leave equal Gaussians:
they are part of the identity of a frame.
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import msgspec
from msgspec import Struct

from engine.editing.actions import Action
from engine.editing.edit import Edit, ObjectTarget, Picked, TargetOfMoment, edits_at
from engine.editing.fills.fill import fits
from engine.editing.scene_object import Objects, at_moment, object_of


class Effect(Struct, frozen=True):
    """The effect of one edit where it holds. See Edit and Scope; its target is one of the moment, see `at_moment`.

    Attributes:
        filled: Gaussians that appear after it, packed; see engine.editing.fills.filled.
    """

    target: TargetOfMoment
    action: Action
    is_inverted: bool = False
    is_reference_only: bool = False
    filled: bytes = b""


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
        return cls.made(effect for edit in edits for effect in _effects_of(edit, frame, objects))

    @classmethod
    def made(cls, effects: Iterable[Effect]) -> Effects:
        """With the digest that belongs to them."""
        effects = tuple(effects)
        if not effects:
            return NO_EFFECTS
        return cls(effects, hashlib.sha256(_ENCODER.encode(effects)).hexdigest()[:20])


def _effects_of(edit: Edit, frame: float, objects: Objects) -> Iterator[Effect]:
    """What one edit does: its own effect and, where it has a fill that fits, that of the fill."""
    target, is_of_reference = at_moment(edit.target, frame, objects), edit.scope.is_reference_only
    if edit.fill is None or not fits(edit):
        yield Effect(target, edit.action, edit.is_inverted, is_of_reference)
        return
    yield Effect(target, edit.action, edit.is_inverted, is_of_reference, edit.fill.gaussians)
    if edit.fill.traces:
        yield Effect(Picked(edit.fill.traces), edit.action)


NO_EFFECTS = Effects()
_ENCODER = msgspec.msgpack.Encoder()


class EditStack:
    """The edits of a document, asked moment by moment: quick, as the window asks for every frame it may show next.

    Args:
        edits: In the order of the stack.
        objects: Of the document, for edits of objects.
    """

    def __init__(self, edits: tuple[Edit, ...] = (), objects: Objects = ()) -> None:
        self.edits, self.objects = edits, objects
        scopes = [edit.scope for edit in edits if edit.is_on]
        bounds = {scope.first for scope in scopes} | {scope.stop for scope in scopes if scope.stop is not None}
        for edit in edits:
            found = object_of(edit.target, objects) if isinstance(edit.target, ObjectTarget) else None
            bounds |= set() if found is None or not edit.is_on else found.bounds
        self._bounds = sorted(bounds - {0})
        self._effects: dict[int, Effects] = {}

    def at(self, frame: float) -> Effects:
        """The effects that hold at a moment, in frames of the capture; between two frames that of the one before."""
        place = bisect_right(self._bounds, math.floor(frame))
        if place not in self._effects:
            first = self._bounds[place - 1] if place else 0
            self._effects[place] = Effects.of(edits_at(self.edits, first), first, self.objects)
        return self._effects[place]
