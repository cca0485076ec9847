"""The keys of the window as tables, one per group of the help sheet."""

from __future__ import annotations

from itertools import groupby

from tests.documents.table import table
from ui.panels.actions.action import Action
from ui.panels.actions.table import ACTIONS


def keys(row: Action) -> str:
    """The keys of an action, each as code."""
    return ", ".join(f"`{label}`" for label in row.keys)


def key_tables() -> str:
    """Every row of the table of actions, in its order."""
    parts = []
    for group, rows in groupby(ACTIONS, key=lambda row: row.group):
        parts.append(f"**{group}**\n\n{table(('key', 'does'), [(keys(row), row.text) for row in rows if row.keys])}")
    return "\n\n".join(parts)
