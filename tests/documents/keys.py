"""The keys of the window as tables, one per group of the help sheet."""

from __future__ import annotations

from tests.documents.table import table
from ui.panels.actions.action import Action
from ui.panels.actions.table import ACTIONS


def keys(row: Action) -> str:
    """The keys of an action, each as code."""
    return ", ".join(f"`{label}`" for label in row.keys)


def key_tables() -> str:
    """Every row of the help sheet, in its order."""
    parts = []
    for group in dict.fromkeys(row.group for row in ACTIONS):
        listed = [row for row in ACTIONS if row.group == group]
        shown = [(keys(row), row.text) for row in listed if row.keys and row.is_in_help]
        parts.append(f"**{group}**\n\n{table(('key', 'does'), shown)}")
        keyless = "; ".join(row.text for row in listed if not row.keys)
        if keyless:
            parts.append(f"No key of their own: {keyless}.")
    return "\n\n".join(parts)
