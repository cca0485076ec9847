"""The parts of a report: sections of sentences, tables and figures, in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from app.lab.report.page.tables import Table


@dataclass(frozen=True, slots=True)
class Figure:
    """One picture.

    Attributes:
        name: File name without suffix.
        png: The file.
        caption: Shown below it.
        alt: A description for those who do not see it.
    """

    name: str
    png: bytes
    caption: str
    alt: str


@dataclass(frozen=True, slots=True)
class Folded:
    """Something long that stands under one line until it is asked for."""

    title: str
    table: Table


Part = str | Table | Figure | Folded
"""A string is a paragraph."""


@dataclass(frozen=True, slots=True)
class Section:
    """One headed part of the page; `anchor` is its name in links."""

    anchor: str
    title: str
    parts: Sequence[Part] = field(default_factory=list)

    def tables(self) -> Iterator[Table]:
        """All of them, those in files only too."""
        for part in self.parts:
            if isinstance(part, Table):
                yield part
            elif isinstance(part, Folded):
                yield part.table

    def figures(self) -> Iterator[Figure]:
        """All of them."""
        return (part for part in self.parts if isinstance(part, Figure))
