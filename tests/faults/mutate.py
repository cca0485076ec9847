"""Damage for files, from a seed: to any bytes, to JSON documents, and to what lies under a name at all."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, [], {}, "", "word", 0, 1, -1, 0.5, -0.0, 1e-300, 1e300, 2**31, 2**63, 10**20),
    *([None], [[]], {"a": 1}, "../../outside", "/dev/zero", "/etc/passwd", "a##b", "%s%n", "\u202e", "x" * 5000),
)
"""Values that JSON can hold and readers do not expect."""
ODD_TEXTS = (
    *("1" + "0" * 400, "-1" + "0" * 400, "9" * 5000, "1e400", "-1e999", "NaN", "Infinity", "-Infinity"),
    *(
        '"\\ud800"',
        '"\\u0000"',
        "[" * 100_000 + "]" * 100_000,
        '{"a":' * 5000 + "1" + "}" * 5000,
        "[" * 200 + "]" * 200,
    ),
)
"""Values as they would stand in a file; most of them no writer makes."""
_PLACE = "put-the-odd-text-here"


def damaged_bytes(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """A file's bytes with one kind of damage. Returns its name and the bytes."""
    name = rng.choice(sorted(_BYTE_DAMAGE))
    return name, _BYTE_DAMAGE[name](data, rng)


def damaged_json(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """A JSON document with one value or key changed, written anew. Returns what was done, and the bytes.

    Checksums inside it stay as they were.
    """
    document = json.loads(data)
    places = _places(document)
    path = rng.choice(places)
    parent, key = _parent(document, path), path[-1] if path else None
    kind = rng.choice(("odd value", "odd text", "odd text", "taken out", "renamed", "near value", "twice"))
    where = ".".join(map(str, path)) or "top level"
    if key is None or (kind in ("renamed", "twice") and not isinstance(parent, dict)):
        kind = "odd value" if kind not in ("odd text", "odd value") else kind
    match kind:
        case "taken out":
            del parent[key]
        case "renamed":
            parent[f"{key}s"] = parent.pop(key)
        case "near value":
            parent[key] = _near(parent[key], rng)
        case "twice":
            text = json.dumps(document)
            return f"{where} twice", text.replace("{", f"{{{json.dumps(key)}: {rng.randrange(9)}, ", 1).encode()
        case "odd text":
            odd = rng.choice(ODD_TEXTS)
            if key is None:
                return f"{where}: {odd[:12]}", odd.encode()
            parent[key] = _PLACE
            return f"{where}: {odd[:12]}", json.dumps(document).replace(f'"{_PLACE}"', odd).encode()
        case _:
            odd = rng.choice(ODD_VALUES)
            if key is None:
                return f"{where}: {odd!r:.12}", json.dumps(odd).encode()
            parent[key] = odd
    return f"{where}: {kind}", json.dumps(document).encode()


def put_odd_file(path: Path, rng: random.Random) -> str:
    """Put something else under a name of a file or folder, or one that cannot be read. Returns what it is."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    kind = rng.choice(
        (
            "pipe",
            "folder",
            "device",
            "dangling link",
            "link to itself",
            "link outside",
            "linked folder",
            "empty",
            "none",
        )
    )
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case "device":
            path.symlink_to("/dev/zero")
        case "dangling link":
            path.symlink_to(path.with_name("not-there"))
        case "link to itself":
            path.symlink_to(path)
        case "link outside":
            path.symlink_to("/etc/passwd")
        case "linked folder":
            path.symlink_to("/etc")
        case "gone":
            pass
        case _:
            path.touch()
    return kind


def _places(document: Any) -> list[tuple[Any, ...]]:
    """Paths of all values, at most 50 of one list, so that matrices do not crowd out the rest."""
    found: list[tuple[Any, ...]] = [()]
    stack: list[tuple[tuple[Any, ...], Any]] = [((), document)]
    while stack:
        path, node = stack.pop()
        children = list(node.items()) if isinstance(node, dict) else list(enumerate(node[:50]))
        for key, child in children:
            found.append((*path, key))
            if isinstance(child, dict | list):
                stack.append(((*path, key), child))
    return found


def _parent(document: Any, path: tuple[Any, ...]) -> Any:
    for key in path[:-1]:
        document = document[key]
    return document


def _near(value: Any, rng: random.Random) -> Any:
    """A value of the same type that no reader can refuse for its type."""
    match value:
        case bool():
            return not value
        case int():
            return value + rng.choice((-1, 1, 1000, -2 * value))
        case float():
            return value * rng.choice((-1.0, 0.0, 1.01, 1e6)) + 1e-3
        case str():
            return value[:-1] + rng.choice("aZ0_ ")
        case list():
            return value[:-1]
        case _:
            return value


# ---------------------------------------------------------------- bytes


def _run(data: bytes, rng: random.Random, longest: int = 64) -> tuple[int, int]:
    """Start and end of a run of bytes; half of them near the beginning, where headers lie."""
    if not data:
        return 0, 0
    start = rng.randrange(len(data) if rng.random() < 0.5 else min(len(data), 600))
    return start, min(len(data), start + rng.randint(1, longest))


def _flip_bit(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng, 1)
    return data[:start] + bytes(byte ^ (1 << rng.randrange(8)) for byte in data[start:end]) + data[end:]


def _other_byte(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng, 1)
    return data[:start] + bytes([rng.choice((0, 0xFF, 0x80, *b'"{}[],:-09ae \n'))]) + data[end:]


def _zeros(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng, 4096)
    return data[:start] + bytes(end - start) + data[end:]


def _noise(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng)
    return data[:start] + rng.randbytes(end - start) + data[end:]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _left_out(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng)
    return data[:start] + data[end:]


def _put_in(data: bytes, rng: random.Random) -> bytes:
    start, _ = _run(data, rng)
    return data[:start] + rng.choice((rng.randbytes(8), b"\xff", b"\n", b"[" * 5000, b"0" * 5000)) + data[start:]


def _swapped(data: bytes, rng: random.Random) -> bytes:
    start, end = _run(data, rng)
    middle = (start + end) // 2
    return data[:start] + data[middle:end] + data[start:middle] + data[end:]


def _longer(data: bytes, rng: random.Random) -> bytes:
    return data + rng.randbytes(rng.choice((1, 100, 10_000)))


def _twice(data: bytes, rng: random.Random) -> bytes:
    return data + data


def _all_noise(data: bytes, rng: random.Random) -> bytes:
    return rng.randbytes(min(len(data), 1 << 20))


_BYTE_DAMAGE: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "bit flipped": _flip_bit,
    "other byte": _other_byte,
    "zeros": _zeros,
    "noise": _noise,
    "cut off": _cut,
    "left out": _left_out,
    "put in": _put_in,
    "swapped": _swapped,
    "longer": _longer,
    "twice": _twice,
    "all noise": _all_noise,
}
