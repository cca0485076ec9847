"""The command that lets a volume follow an object."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FollowObject:
    """Let an edit act on a volume that goes along with an object, in place of what it acts on."""

    object_id: int
    edit_id: int


FollowCommand = FollowObject
