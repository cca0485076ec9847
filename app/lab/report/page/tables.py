"""Table: the numbers of a report, once; shown on the page, and written as CSV and JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.csv_text import csv_text
from app.lab.report.page.markup import Markup, tag

MISSING = "–"
MAX_FIRST_ROWS, MAX_LAST_ROWS = 180, 20
"""Rows of a longer table that the page shows; its files have all of them."""
_WIDE_TEXT = 24
"""Longer texts are broken into lines, but not into narrow ones."""


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One column.

    Attributes:
        key: Name in CSV and JSON, and in the rows.
        title: As shown.
        n_digits: Digits after the point; None shows a number with five digits in all, and anything else as it is.
        is_higher_better: Direction, for an arrow and the best value in bold; None for neither.
        unit: Shown behind the title; empty for none.
        labels: The page's words for values that are texts; files keep those.
        is_shown: Whether it stands on the page, or in files only.
    """

    key: str
    title: str
    n_digits: int | None = None
    is_higher_better: bool | None = None
    unit: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)
    is_shown: bool = True

    @property
    def heading(self) -> str:
        """Title, unit and arrow."""
        unit = f", {self.unit}" if self.unit else ""
        arrow = "" if self.is_higher_better is None else " ↑" if self.is_higher_better else " ↓"
        return f"{self.title}{unit}{arrow}"


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of plain values under columns.

    Attributes:
        name: File name without suffix.
        caption: One sentence.
        rows: A value or None for every column's key; more keys are an error of the caller.
        is_shown: Whether it stands on the page, or in files only.
    """

    name: str
    caption: str
    columns: Sequence[TableColumn]
    rows: list[dict[str, Any]] = field(default_factory=list)
    is_shown: bool = True

    def __post_init__(self) -> None:
        keys = {column.key for column in self.columns}
        for row in self.rows:
            if row.keys() != keys:
                raise ValueError(f"table {self.name}: a row has {sorted(row.keys() ^ keys)} too many or too few")

    def document(self) -> dict[str, Any]:
        """JSON-able: caption, columns (key, title, unit, is_higher_better) and rows."""
        columns = [
            {"key": c.key, "title": c.title, "unit": c.unit, "is_higher_better": c.is_higher_better}
            for c in self.columns
        ]
        return {"caption": self.caption, "columns": columns, "rows": self.rows}

    def csv_text(self) -> str:
        """Comma-separated, keys first, all digits; missing values are empty."""
        return csv_text([column.key for column in self.columns], self.rows)

    def markup(self) -> Markup:
        """As HTML that scrolls when it is too wide. The best value of a column with a direction is bold; of many rows
        the first and the last ones are shown."""
        columns = [column for column in self.columns if column.is_shown]
        best = {column.key: self._best(column) for column in columns}
        kinds = {column.key: "n" if self._is_numeric(column) else None for column in columns}
        heads = [tag("th", column.heading, scope="col", class_=kinds[column.key]) for column in columns]
        body = []
        rows, caption = self.rows, self.caption
        if len(rows) > MAX_FIRST_ROWS + MAX_LAST_ROWS:
            rows = rows[:MAX_FIRST_ROWS] + rows[-MAX_LAST_ROWS:]
            caption += (
                f" (the first {MAX_FIRST_ROWS} and the last {MAX_LAST_ROWS} of {len(self.rows)} rows; all of them are "
                f"in tables/{self.name}.csv)"
            )
        for row in rows:
            cells = []
            for column in columns:
                value = row[column.key]
                text = column.labels.get(str(value)) or value_text(value, column.n_digits)
                is_best = value is not None and value == best[column.key]
                kind = kinds[column.key] or ("w" if len(text) > _WIDE_TEXT else None)
                cells.append(tag("td", tag("b", text) if is_best else text, class_=kind))
            body.append(tag("tr", *cells))
        table = tag(
            "table",
            tag("caption", caption),
            tag("thead", tag("tr", *heads)),
            tag("tbody", *body),
            id=f"table-{self.name}",
        )
        return tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=self.caption)

    def _best(self, column: TableColumn) -> float | None:
        values = [row[column.key] for row in self.rows if row[column.key] is not None]
        if column.is_higher_better is None or len(values) < 2:
            return None
        return max(values) if column.is_higher_better else min(values)

    def _is_numeric(self, column: TableColumn) -> bool:
        values = [row[column.key] for row in self.rows if row[column.key] is not None]
        return column.n_digits is not None or (
            bool(values) and all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
        )


def value_text(value: Any, n_digits: int | None) -> str:
    """A value as the page shows it."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float) and n_digits is not None:
        return f"{value:.{n_digits}f}"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
