"""Cameras that show the same pictures: the same files, or copies of them. Compares sizes, then a few samples."""

from __future__ import annotations

import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from engine.errors import CaptureError
from engine.storage.files import open_regular

SAMPLE_BYTES = 64 << 10
"""Read at the beginning, the middle and the end of a file."""


@dataclass(frozen=True, slots=True)
class CameraFiles:
    """The files of one camera in order of their frames, or its one video, and their sizes in bytes."""

    paths: Sequence[Path]
    n_bytes: Sequence[int]


def check_duplicates(cameras: Mapping[str, CameraFiles]) -> list[CaptureError]:
    """Cameras of the same pictures; one problem for each group. Files are there and readable."""
    by_size = _groups(cameras, lambda name: tuple(cameras[name].n_bytes))
    groups = chain.from_iterable(_groups(same, lambda name: _sample(cameras[name].paths)) for same in by_size)
    return [_problem(names, [cameras[name].paths[0] for name in names]) for names in groups]


def _problem(names: list[str], firsts: list[Path]) -> CaptureError:
    path = firsts[1]
    if os.path.samefile(firsts[0], path):
        how, hint = f"use the same file: {path.name}", "Give each camera its own file, or take one out."
    else:
        how = f"show the same pictures: {firsts[0].name} and {path.name} hold the same bytes"
        hint = "Copy the right file of each camera, or take one out."
    called = " and ".join(f'"{name}"' for name in names[:2])
    if len(names) > 2:
        called += f" and {len(names) - 2} more"
    return CaptureError(f"Cameras {called} {how}.", hint=hint, path=path)


def _groups(names: Iterable[str], key_of: Callable[[str], Hashable]) -> list[list[str]]:
    """Names with equal keys, where there are at least two."""
    found: dict[Hashable, list[str]] = defaultdict(list)
    for name in names:
        found[key_of(name)].append(name)
    return [same for same in found.values() if len(same) > 1]


def _sample(paths: Sequence[Path]) -> bytes:
    """Digest of the first, middle and last file."""
    digest = hashlib.blake2b()
    for row in sorted({0, len(paths) // 2, len(paths) - 1}):
        with open_regular(paths[row]) as file:
            n_bytes = file.seek(0, os.SEEK_END)
            for start in (0, (n_bytes - SAMPLE_BYTES) // 2, n_bytes - SAMPLE_BYTES):
                file.seek(max(start, 0))
                digest.update(file.read(SAMPLE_BYTES))
    return digest.digest()
