"""Effects: what a stack of edits does at one moment, without names and switches. Equal effects leave equal Gaussians:
they are part of the identity of a frame.
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import msgspec
from msgspec import Struct

from engine.editing.actions import Action
from engine.editing.edit import Edit, KeyedVolume, ObjectTarget, Picked, Target, TargetOfMoment, edits_at
from engine.editing.fills.fill import fits
from engine.editing.scene_object import Objects, object_of
from engine.editing.volumes.keyed_volume import volume_at

MAX_MOMENTS = 4096
"""Moments whose effects an EditStack keeps."""


def at_moment(target: Target, frame: float, objects: Objects) -> TargetOfMoment:
    """A target as something that can be looked up in the clip of a moment: Gaussians, a volume in its place then.

    Args:
        frame: In frames of the capture, between frames too.
        objects: Of the document.
    """
    match target:
        case ObjectTarget():
            found = object_of(target, objects)
            return Picked(()) if found is None else found.picked(frame)
        case KeyedVolume():
            return volume_at(target, frame)
        case _:
            return target


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
        return cls(effects, hashlib.sha256(b"".join(map(_digest, effects))).hexdigest()[:20])


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


@lru_cache(maxsize=256)  # while a volume moves, all others stay the same, and some are large
def _digest(effect: Effect) -> bytes:
    return hashlib.sha256(_ENCODER.encode(effect)).digest()


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
        keyed = [edit.target for edit in edits if edit.is_on and isinstance(edit.target, KeyedVolume)]
        self._moving = (
            min((target.keys[0].frame for target in keyed), default=0.0),
            max((target.keys[-1].frame for target in keyed), default=0.0),
        )
        self._effects: dict[tuple[int, float], Effects] = {}

    def at(self, frame: float) -> Effects:
        """The effects that hold at a moment, in frames of the capture; scopes between two frames are those of the one
        before, volumes move between them, too."""
        frame = max(frame, 0.0)
        place = bisect_right(self._bounds, math.floor(frame))
        first, last = self._moving
        moment = place, min(max(frame, first), last)  # before and after it, nothing moves
        found = self._effects.get(moment)
        if found is None:
            if len(self._effects) >= MAX_MOMENTS:
                self._effects.clear()
            found = Effects.of(edits_at(self.edits, frame), frame, self.objects)
            self._effects[moment] = found
        return found
