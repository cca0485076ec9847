"""The tables of the paper as Markdown, from the module that reports take them from."""

from __future__ import annotations

from app.lab.paper_tables import FIGURES, PAPER_TABLES, PaperTable
from tests.documents.table import table


def paper_tables() -> str:
    """All of them, each under its number and capture."""
    return "\n\n".join(f"Table {one.number}, {one.capture.title}:\n\n{_table(one)}" for one in PAPER_TABLES)


def _table(one: PaperTable) -> str:
    figures = [FIGURES[column] for column in one.columns]
    header = [f"{figure.title}, {figure.unit}" if figure.unit else figure.title for figure in figures]
    rows = [
        (row.method, row.family, ", ".join(f"`{name}`" for name in row.variants), *one.texts(row)) for row in one.rows
    ]
    kept = [i for i in range(len(header) + 3) if i == 0 or any(row[i] for row in rows)]
    cells = [("method", "family", "variant here", *header), *rows]
    first, *others = ([line[i] for i in kept] for line in cells)
    return table(first, others)
