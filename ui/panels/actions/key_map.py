"""KeyMap: which keys run which action: an action's own ones, unless the user gave it others. Menus, help sheet, palette
and the keys themselves ask here.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Protocol

from ui.panels.actions.key import Key, parse_key

logger = logging.getLogger(__name__)


class Keyed(Protocol):
    """The part of an action that a key map needs."""

    @property
    def id(self) -> str: ...

    @property
    def keys(self) -> tuple[str, ...]: ...


class KeyMap:
    """Keys of actions.

    Args:
        chosen: By action id, the labels that the user gave it; changed in place, so that they can be kept.
    """

    def __init__(self, chosen: dict[str, list[str]] | None = None) -> None:
        self.chosen: dict[str, list[str]] = {} if chosen is None else chosen
        self._parsed: dict[tuple[str, tuple[str, ...]], tuple[Key, ...]] = {}

    def drop_unknown(self, actions: Iterable[Keyed]) -> None:
        """Forget the user's choices for actions that do not exist, and labels that name no key; each gets a line in
        the log."""
        known = {action.id for action in actions}
        for action_id, labels in list(self.chosen.items()):
            if action_id not in known:
                logger.warning("ignoring keys of an unknown action: %s", ascii(action_id[:80]))
                del self.chosen[action_id]
                continue
            sound = [label for label in labels if _is_key(label)]
            if len(sound) < len(labels):
                logger.warning("ignoring invalid keys of %s: %s", action_id, ascii(labels)[:200])
                if sound:
                    self.chosen[action_id] = sound
                else:  # unreadable keys are not the wish to have none
                    del self.chosen[action_id]

    def labels(self, action: Keyed) -> tuple[str, ...]:
        """Its keys as text; empty where it has none."""
        chosen = self.chosen.get(action.id)
        return action.keys if chosen is None else tuple(chosen)

    def label(self, action: Keyed) -> str:
        """The key that menus show; empty without one."""
        labels = self.labels(action)
        return labels[0] if labels else ""

    def keys(self, action: Keyed) -> tuple[Key, ...]:
        """Its keys, parsed."""
        labels = self.labels(action)
        if (action.id, labels) not in self._parsed:
            self._parsed[action.id, labels] = tuple(parse_key(label) for label in labels)
        return self._parsed[action.id, labels]

    def is_changed(self, action: Keyed) -> bool:
        """Has the user given it other keys than its own?"""
        return action.id in self.chosen

    def owners(self, label: str, actions: Iterable[Keyed]) -> list[Keyed]:
        """Actions that a key runs at present."""
        key = parse_key(label)
        return [action for action in actions if any(key.collides(other) for other in self.keys(action))]

    def assign(self, action: Keyed, label: str, actions: Iterable[Keyed]) -> None:
        """Make this the only key of an action; others that it ran lose it.

        Raises:
            ValueError: The label does not name a key.
        """
        key = parse_key(label)
        for other in actions:
            if other.id != action.id and any(key.collides(theirs) for theirs in self.keys(other)):
                self._set(other, [theirs.label for theirs in self.keys(other) if not key.collides(theirs)])
        self._set(action, [label])

    def clear(self, action: Keyed) -> None:
        """Take all keys of an action."""
        self._set(action, [])

    def reset(self, action: Keyed, actions: Iterable[Keyed]) -> None:
        """Give an action its own keys back; others that took them lose them."""
        for label in action.keys:
            key = parse_key(label)
            for other in actions:
                if other.id != action.id and any(key.collides(theirs) for theirs in self.keys(other)):
                    self._set(other, [theirs.label for theirs in self.keys(other) if not key.collides(theirs)])
        self.chosen.pop(action.id, None)

    def reset_all(self) -> None:
        """Give every action its own keys back."""
        self.chosen.clear()

    def _set(self, action: Keyed, labels: list[str]) -> None:
        if tuple(labels) == action.keys:
            self.chosen.pop(action.id, None)
        else:
            self.chosen[action.id] = labels


def _is_key(label: str) -> bool:
    try:
        parse_key(label)
    except ValueError:
        return False
    return True
