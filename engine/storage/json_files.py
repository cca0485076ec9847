"""JSON files, strictly: bounded in size, depth and digits, no NaN; those of the program carry a checksum.

The checksum is an entry of the document, so that the file stays plain JSON which people can read and edit: who edits
it by hand takes the entry out. It covers the values, not the spaces between them.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from engine.storage.files import atomic_path, read_bytes

MAX_JSON_BYTES = 64 << 20
"""No JSON file that the program reads comes near this."""
MAX_DEPTH = 100
"""Brackets inside brackets; recursive readers of what was read go as deep as that."""
MAX_DIGITS = 40
"""Digits of a whole number; states of random number generators have 39."""
CHECKSUM = "checksum"
HAND_EDITED = f'If it was edited by hand, take out its entry "{CHECKSUM}"; otherwise restore it from a backup.'
"""The remedy for a checksum that does not fit."""
_LARGE_EXPONENT = re.compile(rb"[eE]\+?\d{3}")
_ALL_DIGITS_ZERO = bytes.maketrans(b"123456789", b"0" * 9)
_BLOCK_BYTES = 1 << 20
_HALF_CHARACTER = re.compile(rb"\\u[dD][89a-fA-F]")


class JsonError(ValueError):
    """Not JSON as this program reads it. The text is a reason that fits into brackets behind a sentence."""


class ChecksumError(JsonError):
    """JSON, but not with the values that its checksum was made for: damaged, or edited by hand."""


def parse_json(data: bytes | str, *, is_nan_allowed: bool = False) -> Any:
    """Parse a JSON document.

    Args:
        data: UTF-8.
        is_nan_allowed: Accept NaN and infinities, which files of earlier versions hold as figures not measured.
    Raises:
        JsonError: Not UTF-8, not JSON, nested more than MAX_DEPTH deep, a whole number of more than MAX_DIGITS
            digits, one beyond the range of floats, NaN, or text that is not Unicode.
    """
    raw = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
    try:
        text = raw.decode("utf-8")
        # the checks of numbers cost a call each: only where one may be large
        is_large = b"0" * MAX_DIGITS in raw.translate(_ALL_DIGITS_ZERO) or _LARGE_EXPONENT.search(raw) is not None
        document = json.loads(
            text,
            parse_int=_int if is_large else None,
            parse_float=_float if is_large else None,
            parse_constant=None if is_nan_allowed else _no_constant,
        )
        if _HALF_CHARACTER.search(raw):
            json.dumps(document, ensure_ascii=False).encode("utf-8")
    except UnicodeDecodeError as error:
        raise JsonError(f"byte {error.start} is not UTF-8") from error
    except UnicodeEncodeError as error:
        raise JsonError("a text has half a Unicode character") from error
    except json.JSONDecodeError as error:
        raise JsonError(f"{error.msg} in line {error.lineno}, column {error.colno}") from error
    except RecursionError as error:
        raise JsonError(f"brackets are nested more than {MAX_DEPTH} deep") from error
    if _may_be_deep(raw) and _is_deep(document):
        raise JsonError(f"brackets are nested more than {MAX_DEPTH} deep")
    return document


def _int(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise JsonError(f"a whole number has {len(text)} digits, at most {MAX_DIGITS} are read")
    return int(text)


def _float(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise JsonError(f"the number {text[:20]} is too large")
    return value


def _no_constant(text: str) -> float:
    raise JsonError(f"{text} is not a number of JSON")


def _may_be_deep(raw: bytes) -> bool:
    """Whether brackets, those inside texts included, are nested more than MAX_DEPTH deep."""
    if raw.count(b"[") + raw.count(b"{") <= MAX_DEPTH:
        return False
    depth = 0
    for start in range(0, len(raw), _BLOCK_BYTES):
        block = np.frombuffer(raw, np.uint8, min(_BLOCK_BYTES, len(raw) - start), start)
        letters = block | 0x20  # brackets and braces differ in this bit
        steps = (letters == ord("{")).astype(np.int32) - (letters == ord("}"))
        depths = depth + np.cumsum(steps)
        if depths.max() > MAX_DEPTH:
            return True
        depth = int(depths[-1])
    return False


def _is_deep(document: Any) -> bool:
    level = [document]
    for _ in range(MAX_DEPTH):
        level = [
            child
            for node in level
            for child in (node.values() if isinstance(node, dict) else node)
            if isinstance(child, dict | list)
        ]
        if not level:
            return False
    return True


def parse_object(data: bytes | str, *, is_nan_allowed: bool = False) -> dict[str, Any]:
    """Likewise, of a document whose top level is an object.

    Raises:
        JsonError: See `parse_json`; or the top level is something else.
    """
    document = parse_json(data, is_nan_allowed=is_nan_allowed)
    if not isinstance(document, dict):
        names = {list: "a list", str: "a text", bool: "true or false", type(None): "null"}
        raise JsonError(f"it holds {names.get(type(document), 'a number')}, not an object")
    return document


def read_json_object(path: Path | str, *, max_bytes: int = MAX_JSON_BYTES) -> dict[str, Any]:
    """Read a file that holds one JSON object.

    Raises:
        OSError: It cannot be read, is not a regular file, or larger than `max_bytes`; see
        engine.storage.files.read_bytes. JsonError: See `parse_object`.
    """
    return parse_object(read_bytes(path, max_bytes=max_bytes))


def json_text(document: Any, *, indent: int | None = None) -> str:
    """A document as JSON for others to read: what is not a finite number becomes null, since JSON has no NaN.

    Only ASCII characters, so that it can be printed anywhere, whatever names it holds.
    """
    try:
        return json.dumps(document, indent=indent, allow_nan=False)
    except ValueError:  # NaN is rare
        return json.dumps(_without_nan(document), indent=indent, allow_nan=False)


def _without_nan(value: Any) -> Any:
    match value:
        case float():
            return value if math.isfinite(value) else None
        case dict():
            return {key: _without_nan(child) for key, child in value.items()}
        case list() | tuple():
            return [_without_nan(child) for child in value]
        case _:
            return value


def write_checked_json(
    path: Path | str, document: dict[str, Any], *, makes_parents: bool = True, is_durable: bool = False
) -> None:
    """Write a document with its checksum, atomically.

    Args:
        path, makes_parents, is_durable: As of engine.storage.files.atomic_path.

    Raises:
        OSError: The disk refused.
        ValueError: The document holds NaN.
    """
    text, _ = checked_text(document)
    with atomic_path(path, makes_parents=makes_parents, is_durable=is_durable) as partial:
        partial.write_text(text, encoding="utf-8")


def checked_text(document: dict[str, Any], *, is_for_people: bool = True) -> tuple[str, str]:
    """The text that `write_checked_json` writes, and the checksum in it.

    Args:
        is_for_people: Over many lines, which takes several times as long.

    Raises:
        ValueError: The document holds NaN.
    """
    checksum = checksum_of(document)
    return json.dumps(
        document | {CHECKSUM: checksum}, indent=2 if is_for_people else None, allow_nan=False
    ) + "\n", checksum


def read_checked_json(path: Path | str, *, max_bytes: int = MAX_JSON_BYTES) -> dict[str, Any]:
    """Read what `write_checked_json` wrote, without the checksum; a file that has none is taken as it is.

    Raises:
        OSError: See `read_json_object`.
        JsonError: See there. ChecksumError: The content is not that which the checksum was made for.
    """
    return without_checksum(read_json_object(path, max_bytes=max_bytes))[0]


def without_checksum(document: dict[str, Any]) -> tuple[dict[str, Any], str | None]:
    """A document without its checksum, and the checksum; None where it has none.

    Raises:
        ChecksumError: The content is not that which the checksum was made for.
    """
    stated = document.pop(CHECKSUM, None)
    if stated is not None and stated != checksum_of(document):
        raise ChecksumError("its content does not fit its checksum")
    return document, stated


def checked_line(row: dict[str, Any]) -> str:
    """One line of a file of rows, with a checksum of its own: a bad byte costs that row and no other."""
    return json.dumps(row | {CHECKSUM: checksum_of(row)}) + "\n"


def read_checked_lines(path: Path | str, *, max_bytes: int = MAX_JSON_BYTES) -> tuple[list[dict[str, Any]], int]:
    """Rows written with `checked_line`, and the number of lines that were left out as damaged.

    Lines without a checksum are taken as they are while none had one: that is how earlier versions wrote them.

    Raises:
        OSError: See `read_json_object`.
    """
    rows: list[dict[str, Any]] = []
    n_damaged, is_checked = 0, False
    *lines, unfinished = read_bytes(path, max_bytes=max_bytes).split(b"\n")
    for line in [*lines, unfinished]:
        if not line.strip():
            continue
        try:
            row = parse_object(line, is_nan_allowed=True)
        except JsonError:
            n_damaged += line is not unfinished  # that one may be on its way, or was cut off by a kill
            continue
        stated = row.pop(CHECKSUM, None)
        is_checked |= stated is not None
        if is_checked and stated != checksum_of(row):
            n_damaged += 1
        else:
            rows.append(row)
    return rows, n_damaged


def checksum_of(document: dict[str, Any]) -> str:
    """The checksum of values as a reader gets them: tuples are lists by then, and keys are text."""
    values = json.loads(json.dumps(document))
    canonical = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return f"crc32:{zlib.crc32(canonical.encode()):08x}"
