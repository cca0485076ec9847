"""Actions of edits, by name: for scripts that would rather write a word than import a value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from engine.editing.actions import ACTIONS, Action
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown

_OPPOSITES = {kind.opposite: kind for kind in ACTIONS.values() if kind.opposite}
"""Actions that act on everything but the target, by the name that they have then."""


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
                f"{type(action).__name__} is given together with {shown(next(iter(values)))}.",
                hint="Put it into the action, or name the action.",
            )
        return action, False
    known = ACTIONS | _OPPOSITES
    if action not in known:
        raise ProjectError(f"There is no edit {shown(action)}.", hint=f"Edits are {', '.join(known)}.")
    try:
        return to_type(dict(values), known[action]), action in _OPPOSITES
    except EntryError as error:
        raise ProjectError(f"The edit {shown(action)} is not valid ({error}).") from error
