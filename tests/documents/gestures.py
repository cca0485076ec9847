"""What the mouse does, as a table with a column per preset, and what it does with each of them."""

from __future__ import annotations

from tests.documents.table import table
from ui.panels.picture.gestures import GESTURE_WORDS, PRESETS, gesture_rows, mouse_help


def gesture_tables() -> str:
    """One table of what presets differ in, one of the rest."""
    presets = list(PRESETS.values())
    found = [gesture_rows(preset) for preset in presets]
    rows = [
        (words, *(", ".join(done for done, does in column if does == words) for column in found))
        for words in GESTURE_WORDS.values()
    ]
    others = mouse_help(presets[0])[len(found[0]) :]
    return f"{table(('does', *(preset.title for preset in presets)), rows)}\n\n{table(('mouse', 'does'), others)}"
