"""Commands about objects, as frozen dataclasses in the imperative. They can be taken back, but for FindObject and
SelectObject, which change nothing that somebody has decided.
"""

from __future__ import annotations

from dataclasses import dataclass

from engine.editing.actions import Vector


@dataclass(frozen=True, slots=True)
class MakeObject:
    """Make an object of what is selected in the shown frame, and look for it in all clips."""

    name: str = ""
    """An empty one is replaced by the first free "object N"."""


@dataclass(frozen=True, slots=True)
class CorrectObject:
    """The selection of the shown frame belongs to an object, or does not; then look for it again."""

    object_id: int
    adds: bool


@dataclass(frozen=True, slots=True)
class FindObject:
    """Look for an object in all clips again."""

    object_id: int


@dataclass(frozen=True, slots=True)
class SelectObject:
    """Select the Gaussians that an object consists of in the shown frame."""

    object_id: int


@dataclass(frozen=True, slots=True)
class RemoveObject:
    """Remove an object, and the edits that act on it."""

    object_id: int


@dataclass(frozen=True, slots=True)
class RenameObject:
    """Give an object another name."""

    object_id: int
    name: str


@dataclass(frozen=True, slots=True)
class RecolourObject:
    """Give an object another colour, RGB in 0..1. gesture: See app.session.editing.edit_commands."""

    object_id: int
    color: Vector
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class SetObjectSpan:
    """Let an object exist in some frames only. stop: One after the last; None for all that follow."""

    object_id: int
    first: int
    stop: int | None


@dataclass(frozen=True, slots=True)
class SetObjectTrained:
    """Let clips that are trained from now on see an object, or not: it is masked in the pictures of the clips in which
    it was found."""

    object_id: int
    is_trained: bool


ObjectCommand = (
    MakeObject
    | CorrectObject
    | FindObject
    | SelectObject
    | RemoveObject
    | RenameObject
    | RecolourObject
    | SetObjectSpan
    | SetObjectTrained
)
