"""Commands that change the copies of objects, as frozen dataclasses in the imperative. A gesture is as in
app.session.editing.edit_commands.
"""

from __future__ import annotations

from dataclasses import dataclass

from engine.editing.actions import Vector
from engine.editing.copies.object_copy import ObjectCopy


@dataclass(frozen=True, slots=True)
class DuplicateObject:
    """Show an object once more, or several times, each farther by the same step."""

    copy: ObjectCopy
    """The first copy; its number is of no account, and an empty name is filled in."""
    n_times: int = 1


@dataclass(frozen=True, slots=True)
class MakeCrowd:
    """Fill rows with copies of an object, which stands at the corner; see app.document.changes.copy_changes.crowd."""

    copy: ObjectCopy
    n_across: int
    n_along: int
    across: Vector
    along: Vector
    shift_frames: float = 0.0


@dataclass(frozen=True, slots=True)
class ChangeCopy:
    """Put a copy in the place of the one that has its number."""

    copy: ObjectCopy
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class RemoveCopies:
    """Remove these copies."""

    copy_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SwitchCopies:
    """Let these copies count, or not."""

    copy_ids: tuple[int, ...]
    is_on: bool


CopyCommand = DuplicateObject | MakeCrowd | ChangeCopy | RemoveCopies | SwitchCopies
"""Commands that change copies, and can be taken back."""
