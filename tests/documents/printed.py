"""Tables that a command printed: as Markdown, or in columns that are two or more spaces apart."""

from __future__ import annotations

import re


def printed_tables(text: str) -> list[list[list[str]]]:
    """Every table in what a command printed, headings first; all rows of one have as many cells."""
    found: list[list[list[str]]] = []
    rows: list[list[str]] = []
    for line in [*text.splitlines(), ""]:
        cells = _cells(line)
        if cells is not None and all(re.fullmatch(r":?-+:?", cell) for cell in cells):
            continue  # the rule under the headings
        if cells is not None and (not rows or len(cells) == len(rows[0])):
            rows.append(cells)
            continue
        if len(rows) > 1:
            found.append(rows)
        rows = [] if cells is None else [cells]
    return found


def _cells(line: str) -> list[str] | None:
    if line.startswith("|"):
        return [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
    if re.fullmatch(r"-{3,}", line.rstrip()):
        return [line.strip()]
    cells = [cell.strip() for cell in re.split(r" {2,}", line.rstrip())]
    return cells if len(cells) > 2 else None
