"""Damage to the tables of captures, whatever their format: to numbers and names in texts, to fields of binaries."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path

from tests.faults.mutate import ODD_VALUES, damaged_bytes, damaged_json

NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
WORD = re.compile(rb"[A-Za-z_][\w]{1,}")
ODD_NUMBERS = (
    *(b"0", b"-1", b"1e300", b"-1e300", b"1e-300", b"1e400", b"nan", b".nan", b"NaN", b".Inf", b"-.inf", b"Infinity"),
    *(
        b"9" * 400,
        b"9" * 5000,
        b"2147483648",
        b"-2147483649",
        b"18446744073709551616",
        b"1_000",
        b"0x10",
        b"1,5",
        b"1.",
    ),
    *(b"", b'""', b"[]", b"{}", b"true", b"null", b"~", b"*a", b"&a", b"!!python/object:os.system", b"[[[[1]]]]"),
)
ODD_WORDS = (
    b"",
    b" ",
    b"../..",
    b"/dev/zero",
    b"\xff\xfe",
    b"\x00",
    b"%s%n",
    b"a" * 5000,
    "été".encode(),
    b"\xed\xa0\x80",
)
FRAME_SUFFIXES = (".mp4", ".png", ".jpg")


def tables_of(folder: Path) -> list[Path]:
    """Every file of a capture that is neither a picture nor a video."""
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix not in FRAME_SUFFIXES)


def damaged_table(path: Path, rng: random.Random) -> tuple[str, bytes]:
    """The content of a table with one thing changed. Returns what, and the bytes."""
    data = path.read_bytes()
    kinds = ["bytes"]
    if path.suffix == ".json":
        kinds += ["json", "json"]
    if path.suffix in (".bin", ".npy", ".ply"):
        kinds += ["field", "field", "field"]
    else:
        kinds += ["number", "number", "word", "line"]
    match rng.choice(kinds):
        case "json":
            return damaged_json(data, rng)
        case "field":
            return _damaged_field(data, rng)
        case "number":
            return _replaced(data, NUMBER, ODD_NUMBERS, rng)
        case "word":
            return _replaced(data, WORD, ODD_WORDS, rng)
        case "line":
            return _damaged_lines(data, rng)
        case _:
            return damaged_bytes(data, rng)


def _replaced(data: bytes, pattern: re.Pattern[bytes], odd: tuple[bytes, ...], rng: random.Random) -> tuple[str, bytes]:
    found = list(pattern.finditer(data))
    if not found:
        return damaged_bytes(data, rng)
    match, other = rng.choice(found), rng.choice(odd)
    if rng.random() < 0.2:  # near what is there, so that it is read
        other = rng.choice((b"-" + match[0], match[0] + b"0", match[0][:-1], rng.choice(found)[0]))
    what = f"{match[0]!r:.20} at {match.start()} becomes {other!r:.20}"
    return what, data[: match.start()] + other + data[match.end() :]


def _damaged_lines(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    lines = data.split(b"\n")
    row = rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            return f"line {row} left out", b"\n".join(lines[:row] + lines[row + 1 :])
        case 1:
            return f"line {row} twice", b"\n".join(lines[: row + 1] + lines[row:])
        case 2:
            return f"line {row} indented", b"\n".join([*lines[:row], b"  " + lines[row], *lines[row + 1 :]])
        case 3:
            return "many empty lines", b"\n".join(lines[:row]) + b"\n" * 100_000 + b"\n".join(lines[row:])
        case _:
            odd = str(rng.choice(ODD_VALUES)).encode("utf-8", "replace")
            return f"line {row} is {odd!r:.20}", b"\n".join([*lines[:row], odd, *lines[row + 1 :]])


def _damaged_field(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Four or eight bytes of a binary become a count or a number that no writer makes."""
    values: list[bytes] = [struct.pack("<Q", value) for value in (0, 1, 2**31, 2**40, 2**63, 2**64 - 1)]
    values += [struct.pack("<I", value) for value in (0, 1, 255, 2**31, 2**32 - 1)]
    values += [struct.pack("<d", value) for value in (float("nan"), float("inf"), 1e300, -1e300, 0.0, -1.0)]
    value = rng.choice(values)
    at = rng.randrange(0, max(len(data) - len(value), 1))
    at = at - at % 4 if rng.random() < 0.8 else at
    return f"{value.hex()} at {at}", data[:at] + value + data[at + len(value) :]
