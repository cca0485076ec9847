"""Reads the YAML that OpenCV's FileStorage writes for calibrations: numbers, texts, lists of them, and matrices.

YAML at large allows far more, and libraries for it refuse or misread these files: "%YAML:1.0" is not a directive,
"!!opencv-matrix" not a known tag, and a camera called 010 becomes the number 8. What FileStorage never writes
(anchors, aliases, other tags, nested maps) is refused here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from engine.errors import CaptureError
from engine.storage.files import read_bytes
from engine.text import shown

MAX_BYTES = 4 << 20
"""Of one file; a camera takes a kilobyte."""
MAX_ELEMENTS = 1000
"""Of one matrix. Calibrations have no more than 16."""
MAX_ITEMS = 100_000
"""Of one list."""
MATRIX_TAG = "!!opencv-matrix"

Value = str | list[str] | np.ndarray

_ITEM = re.compile(r" *-(?: +(?P<rest>.*))?$")
_INDICATORS = frozenset("-&*!|>{}[]%@`")
"""Characters that begin something other than plain text."""
_ODD_NUMBERS = {".nan": "nan", ".inf": "inf", "-.inf": "-inf", "+.inf": "inf"}


class YamlError(ValueError):
    """The text is not what FileStorage writes. The message names the line and fits into brackets."""


def read_opencv_yaml(path: Path) -> dict[str, Value]:
    """Entries of a file by name: texts (numbers too), lists of texts, matrices [rows, cols] float64.

    Raises:
        CaptureError: It is missing, not readable, too large or not such a file.
    """
    try:
        data = read_bytes(path, max_bytes=MAX_BYTES)
    except FileNotFoundError:
        raise CaptureError("The file is missing.", hint="Put it back or export it again.", path=path) from None
    except OSError as error:
        text = f"The file cannot be read ({error.strerror})."
        raise CaptureError(text, hint="Check that you may read it.", path=path) from error
    try:
        return parse_opencv_yaml(data)
    except YamlError as error:
        text = f"The file is not YAML as OpenCV writes it ({error})."
        raise CaptureError(text, hint="It may be cut off or damaged; export it again.", path=path) from error


def parse_opencv_yaml(data: bytes) -> dict[str, Value]:
    """Likewise, of the content of a file.

    Raises:
        YamlError: Not UTF-8, a construct that is not known, a name that occurs twice, a matrix without its numbers.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise YamlError(f"byte {error.start} is not UTF-8") from error
    lines = _Lines(text)
    found: dict[str, Value] = {}
    while (line := lines.peek()) is not None:
        row = lines.row
        name, rest = _key(line, row, is_indented=False)
        lines.take()
        if name in found:
            raise YamlError(f"{shown(name)} occurs twice, in line {row} again")
        found[name] = _value(rest, lines, row)
    return found


def number(value: Value | None) -> float | None:
    """A text as a number, NaN and infinity included; None when it is anything else."""
    if not isinstance(value, str):
        return None
    try:
        return _number(value)
    except ValueError:
        return None


class _Lines:
    """Lines that say something, one by one, without comments and document marks."""

    def __init__(self, text: str) -> None:
        self._lines = self._said(text)
        self._next: str | None = None
        self.row = 0
        self.take()

    def peek(self) -> str | None:
        """The line that comes next; None at the end."""
        return self._next

    def take(self) -> str | None:
        """The next line, and continue."""
        taken = self._next
        self._next = next(self._lines, None)
        return taken

    def _said(self, text: str) -> Iterator[str]:
        start = 0
        while start < len(text):  # not split(): a file of line breaks would take many times its size
            end = text.find("\n", start)
            end = len(text) if end < 0 else end
            line = text[start:end].rstrip()
            start = end + 1
            self.row += 1
            is_mark = line in ("---", "...") or (line.startswith("%YAML") and self.row == 1)
            if line and not is_mark and not line.lstrip().startswith("#"):
                if "\t" in line[: len(line) - len(line.lstrip())]:
                    raise YamlError(f"line {self.row} is indented with tabs")
                yield line


def _key(line: str, row: int, *, is_indented: bool) -> tuple[str, str]:
    """The name that a line gives a value, and the rest of the line."""
    text = line.lstrip()
    if text.startswith('"'):
        end = text.find('"', 1)
        name, rest = text[1:end], text[end + 1 :].lstrip()
        is_key = end > 0 and rest.startswith(":")
        rest = rest[1:]
    else:
        end = text.find(": ")
        end = len(text) - 1 if end < 0 and text.endswith(":") else end
        name, rest = text[:end].rstrip(), text[end + 1 :]
        is_key = end > 0 and name[0] not in _INDICATORS
    if not is_key or is_indented != (text != line):
        raise YamlError(f"line {row} is {shown(text)}, not a name with its value")
    return name, rest.strip()


def _value(rest: str, lines: _Lines, row: int) -> Value:
    if rest.startswith(MATRIX_TAG) and not rest[len(MATRIX_TAG) :].split("#")[0].strip():
        return _matrix(lines, row)
    if rest.startswith("["):
        return _flow(rest, lines, row, MAX_ITEMS)
    if rest and not rest.startswith("#"):
        return _scalar(rest, row)
    items: list[str] = []
    while (line := lines.peek()) is not None and (match := _ITEM.fullmatch(line)) is not None:
        items.append(_scalar(match["rest"] or "", lines.row))
        lines.take()
        if len(items) > MAX_ITEMS:
            raise YamlError(f"the list in line {row} has more than {MAX_ITEMS:,} items")
    return items


def _matrix(lines: _Lines, row: int) -> np.ndarray:
    parts: dict[str, str | list[str]] = {}
    while (line := lines.peek()) is not None and line.startswith(" "):
        at = lines.row
        name, rest = _key(line, at, is_indented=True)
        lines.take()
        if name in parts:
            raise YamlError(f"{shown(name)} occurs twice in the matrix of line {row}")
        parts[name] = _flow(rest, lines, at, MAX_ELEMENTS) if rest.startswith("[") else _scalar(rest, at)
    rows, cols, data, dt = (parts.get(key) for key in ("rows", "cols", "data", "dt"))
    if not (isinstance(rows, str) and isinstance(cols, str) and isinstance(data, list)):
        raise YamlError(f"the matrix in line {row} has no rows, cols or data")
    if not (_is_count(rows) and _is_count(cols)) or int(rows) * int(cols) != len(data):
        raise YamlError(f"the matrix in line {row} has {len(data)} numbers, not {shown(rows)} x {shown(cols)}")
    if dt is not None and dt not in ("d", "f", "i", "u", "w", "c", "s"):
        raise YamlError(f"the matrix in line {row} holds {shown(dt)}, not single numbers")
    try:
        values = [_number(item) for item in data]
    except ValueError:
        raise YamlError(f"the matrix in line {row} does not hold only numbers") from None
    return np.array(values, dtype=np.float64).reshape(int(rows), int(cols))


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= 4


def _flow(rest: str, lines: _Lines, row: int, most: int) -> list[str]:
    """Items of a list in brackets, which may go over several lines."""
    items: list[str] = []
    text = rest[1:]
    while True:
        text = text.split(" #", 1)[0].rstrip()
        is_last = text.endswith("]")
        body = text[:-1] if is_last else text
        if any(sign in body for sign in "[]{}"):
            raise YamlError(f"the list in line {row} is nested")
        if body.count(",") + len(items) > most:
            raise YamlError(f"the list in line {row} has more than {most:,} items")
        parts = [part.strip() for part in body.split(",")]
        if parts and not parts[-1]:
            parts.pop()  # the comma at the end of a line, or an empty list
        if not all(parts):
            raise YamlError(f"the list in line {row} has an empty item")
        items += [_scalar(part, row) for part in parts]
        if is_last:
            return items
        line = lines.take()
        if line is None or not line.startswith(" "):
            raise YamlError(f"the list in line {row} does not end")
        text = line.strip()


def _scalar(text: str, row: int) -> str:
    """A plain or quoted text."""
    if text[:1] in ('"', "'"):
        quote = text[0]
        end = text.find(quote, 1)
        if end < 0 or text[end + 1 :].split("#")[0].strip() or "\\" in text[:end]:
            raise YamlError(f"the quotes in line {row} do not close, or hold escapes")
        return text[1:end]
    plain = text.split(" #", 1)[0].strip()
    if plain[:1] in _INDICATORS.difference("-"):
        raise YamlError(f"line {row} has {shown(plain)}, which is not supported")
    return plain


def _number(text: str) -> float:
    text = text.strip()
    if "_" in text:  # Python reads 1_000 as a number
        raise ValueError(text)
    return float(_ODD_NUMBERS.get(text.lower(), text))
