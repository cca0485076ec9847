"""Generated blocks of the documents: `<!-- generated: NAME -->` to `<!-- end -->`, filled with what NAME stands for."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tests.documents.answers import answers_table
from tests.documents.commands import command_sections
from tests.documents.edits import edits_table
from tests.documents.exports import export_tables
from tests.documents.gestures import gesture_tables
from tests.documents.keys import key_tables
from tests.documents.ledger import (
    HEADLINE,
    PAPER_PRESET,
    beside_published_table,
    calm_table,
    headline_table,
    ledger_table,
    names,
    paper_preset_table,
    quality_table,
)
from tests.documents.paper import paper_tables
from tests.documents.published import differences_table, published_table
from tests.documents.settings import presets_table, settings_tables

ROOT = Path(__file__).resolve().parents[2]
GENERATORS: dict[str, Callable[[], str]] = {
    "keys": key_tables,
    "gestures": gesture_tables,
    "commands": command_sections,
    "edits": edits_table,
    "settings": settings_tables,
    "exports": export_tables,
    "presets": presets_table,
    "published": published_table,
    "differences": differences_table,
    "paper": paper_tables,
    "quality": quality_table,
    "headline": headline_table,
    "answers": answers_table,
    "calm": calm_table,
    "beside-published": beside_published_table,
    "paper-preset": paper_preset_table,
    **{f"table-{name}": partial(ledger_table, name) for name in names() if name not in (*HEADLINE, *PAPER_PRESET)},
}
"""What each block is filled with."""
_BLOCK = re.compile(r"(<!-- generated: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def documents() -> list[Path]:
    """The documents that a reader opens."""
    return [ROOT / "README.md", ROOT / "ARCHITECTURE.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


def block_names(text: str) -> list[str]:
    """Names of the generated blocks in a document."""
    return [match[2] for match in _BLOCK.finditer(text)]


def filled(text: str) -> str:
    """A document with every block as the code would have it now. Raises KeyError for a block that nothing generates."""
    return _BLOCK.sub(lambda match: f"{match[1]}{GENERATORS[match[2]]().strip()}\n{match[3]}", text)


def write() -> list[Path]:
    """Fill all documents; returns those that changed."""
    changed = []
    for path in documents():
        text = path.read_text("utf-8")
        if (new := filled(text)) != text:
            path.write_text(new, "utf-8")
            changed.append(path)
    return changed
