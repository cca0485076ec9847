"""What an edit does, by its name: for scripts that would rather write a word than import a value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from engine.editing.edit import Action, Hide
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown

ISOLATE = "isolate"
"""Hide everything but the target."""
ACTION_NAMES = ("hide", "delete", "transform", "recolor", "expose", "hold", "smooth", ISOLATE)


class _Said(Struct):
    """A tagged union is read as an entry of something."""

    action: Action


def action_called(action: Action | str, values: Mapping[str, Any]) -> tuple[Action, bool]:
    """The action of a name and its entries; one that is a value already stays.

    Returns:
        The action, and whether it acts on everything but its target.
    Raises:
        ProjectError: There is no such action or entry, or a value is out of range.
    """
    if not isinstance(action, str):
        if values:
            raise ProjectError(
                f"{type(action).__name__} is given with {shown(next(iter(values)))} beside it.",
                hint="Put it into the action, or give the action by its name.",
            )
        return action, False
    if action == ISOLATE and not values:
        return Hide(), True
    if action not in ACTION_NAMES:
        raise ProjectError(f"There is no edit {shown(action)}.", hint=f"Edits are {', '.join(ACTION_NAMES)}.")
    try:
        return to_type({"action": {"type": action, **values}}, _Said).action, False
    except EntryError as error:
        raise ProjectError(f"The edit {shown(action)} makes no sense ({error}).") from error
