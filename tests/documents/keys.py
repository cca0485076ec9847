"""The keys of the window as tables, one per group of the help sheet."""

from __future__ import annotations

from itertools import groupby

from tests.documents.table import table
from ui.panels.shortcuts import SHORTCUTS


def key_tables() -> str:
    """Every row of the table of shortcuts, in its order."""
    parts = []
    for group, rows in groupby(SHORTCUTS, key=lambda row: row.group):
        parts.append(f"**{group}**\n\n{table(('key', 'does'), [(f'`{row.label}`', row.text) for row in rows])}")
    return "\n\n".join(parts)
