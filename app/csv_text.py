"""Tables as comma-separated text that a spreadsheet shows and never computes."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from engine.text import printable

_FORMULA_STARTS = ("=", "+", "-", "@", "\n")


def csv_text(names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """A header line of names and a line per row; numbers with all digits, None as nothing.

    Text that a spreadsheet would take for a formula, such as a camera called =1+1, begins with an apostrophe.

    Raises:
        ValueError: A row has other keys than the names.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([_cell(name) for name in names])
    for row in rows:
        if row.keys() != set(names):
            raise ValueError(f"a row has {sorted(row.keys() ^ set(names))} too many or too few")
        writer.writerow([_cell(row[name]) for name in names])
    return buffer.getvalue()


def _cell(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    text = printable(value)  # tabs and carriage returns begin formulas too
    return f"'{text}" if text.startswith(_FORMULA_STARTS) and not _is_number(text) else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
