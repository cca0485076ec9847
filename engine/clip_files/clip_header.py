"""The header of a clip file, looked at once when it is read: every entry that is there has a type that readers expect.

A header of another kind is a damaged file; nothing behind this module looks at the type of an entry again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

SCHEMA = 2
READABLE = (1, SCHEMA)
"""Schema 1 knew no compact form; its files are read like any other that holds its arrays as they are."""
_MAX_INDEX = 2**31
"""Frames, steps, clips and anchors are fewer."""
_MAX_SIDE = 2**24
"""Likewise cells, table entries and widths of layers."""
_MAX_TABLE_VALUES = 2**28
"""Likewise all values of a field's tables: its memory is taken before the arrays are compared with it."""


class HeaderError(ValueError):
    """An entry of a header is missing or of the wrong kind. The text is a reason that fits into brackets."""


def check_header(header: dict[str, Any]) -> dict[str, Any]:
    """See that a header is one. Returns it.

    Raises:
        HeaderError: An entry is missing or of the wrong kind; names it.
    """
    missing = [name for name in ("role", "clip_index", "step", "n_steps") if name not in header]
    if missing:
        raise HeaderError(f"its header has no {missing[0]}")
    for name, is_right in _ENTRIES.items():
        if name in header and not is_right(header[name]):
            raise HeaderError(f"its header has {name} {header[name]!r:.60}")
    if header["role"] == "source" and "fingerprint" in header and "reference_fingerprint" not in header:
        raise HeaderError("its header has no reference_fingerprint")
    return header


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value < _MAX_INDEX


def _is_size(value: Any) -> bool:
    return type(value) is int and 0 < value <= _MAX_SIDE


def _is_length(value: Any) -> bool:
    return type(value) in (int, float) and 0 < value < 1e30


def _is_text(value: Any) -> bool:
    return type(value) is str


def _is_texts(value: Any) -> bool:
    return type(value) is list and all(map(_is_text, value))


def _is_counts(value: Any) -> bool:
    return type(value) is dict and all(map(_is_count, value.values()))


def _is_plain(value: Any) -> bool:
    """A flat table of numbers and texts."""
    return type(value) is dict and not any(isinstance(item, list | dict) for item in value.values())


def _is_coverage(value: Any) -> bool:
    numbers = ("share", "n_residual", "n_left_out")
    return _is_plain(value) and all(type(value.get(name, 0)) in (int, float) for name in numbers)


def _is_field(value: Any) -> bool:
    sizes = ("n_knots", "n_entries", "channels", "hidden", "feature_dim")
    if type(value) is not dict or not all(_is_size(value.get(name)) for name in sizes):
        return False
    cells, corner = value.get("cells"), value.get("bounds_min")
    if type(cells) is not list or not all(map(_is_size, cells)) or not _is_length(value.get("side")):
        return False
    if type(corner) is not list or len(corner) != 3 or not all(type(x) in (int, float) for x in corner):
        return False
    n_values = value["n_knots"] * value["n_entries"] * value["channels"] * len(cells)
    return n_values <= _MAX_TABLE_VALUES and all(map(math.isfinite, corner))


def _or_none(is_right: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or is_right(value)


_ENTRIES: dict[str, Callable[[Any], bool]] = {
    "role": lambda value: value in ("reference", "source"),
    **dict.fromkeys(("clip_index", "n_frames", "start", "step", "n_steps", "n_alive"), _is_count),
    "seed": lambda value: type(value) is int,
    "clip_length": _is_size,
    **dict.fromkeys(("near_plane", "spacing"), _is_length),
    "moving_spacing": lambda value: value in (None, 0) or _is_length(value),
    **dict.fromkeys(("fingerprint", "reference_fingerprint", "previous_fingerprint"), _is_text),
    "camera_names": _is_texts,
    "n_anchors": _is_counts,
    "decoder": lambda value: type(value) is dict and all(map(_is_size, value.values())),
    "field": _or_none(_is_field),
    "coverage": _or_none(_is_coverage),
    "config": lambda value: type(value) is dict,
    "metrics": _or_none(lambda value: type(value) is dict),
}
