"""Under which name the files of each clip lie. A clip that covers other frames has other files.

Clips of equal length are numbered: 0003. A clip that was split off or merged is named by its frames: 000030-000035 for
[30, 35). A name follows from the frames alone, so that files stay where they are when clips before them are split or
merged, and are there again when that is taken back.
"""

from __future__ import annotations

import itertools
import re
from functools import lru_cache
from pathlib import Path

PROGRAM_NAME = re.compile(r"\d{4,9}|\d{6,9}-\d{6,9}")
"""Names that this module gives."""


def clip_name(clip_index: int, clip_bounds: tuple[int, ...] | None, clip_length: int) -> str:
    """The name of a clip's files.

    Args:
        clip_index: Of the clip; an index that no clip has gets a name that no clip has.
        clip_bounds: See ProjectSettings.clip_bounds.
        clip_length: M.
    """
    if clip_bounds is None:
        return f"{clip_index:04d}"
    names = _names(clip_bounds, clip_length)
    return names[clip_index] if 0 <= clip_index < len(names) else f"none-{clip_index}"


@lru_cache(maxsize=64)
def _names(clip_bounds: tuple[int, ...], clip_length: int) -> tuple[str, ...]:
    n_frames = clip_bounds[-1]
    names = []
    for start, stop in itertools.pairwise(clip_bounds):
        is_regular = start % clip_length == 0 and stop == min(start + clip_length, n_frames)
        names.append(f"{start // clip_length:04d}" if is_regular else f"{start:06d}-{stop:06d}")
    return tuple(names)


def is_clip_file(name: str) -> bool:
    """Whether this is a file name that clips have."""
    stem, _, suffix = name.rpartition(".")
    return suffix == "safetensors" and PROGRAM_NAME.fullmatch(stem) is not None


def index_of(name: str, clip_bounds: tuple[int, ...] | None, clip_length: int) -> int | None:
    """Inverse of `clip_name`; None for a name that no clip has as they are cut now."""
    if clip_bounds is None:
        return int(name) if name.isascii() and name.isdecimal() else None
    return _ranks(clip_bounds, clip_length).get(name)


@lru_cache(maxsize=64)
def _ranks(clip_bounds: tuple[int, ...], clip_length: int) -> dict[str, int]:
    return {name: index for index, name in enumerate(_names(clip_bounds, clip_length))}


def finished_files(folder: Path, clip_bounds: tuple[int, ...] | None, clip_length: int) -> list[tuple[int, Path]]:
    """Index and file of every finished clip in a project folder, in order; without those of other cuts."""
    found = [path for path in (folder / "clips").glob("*.safetensors") if is_clip_file(path.name)]
    ranked = [(index_of(path.stem, clip_bounds, clip_length), path) for path in found]
    return sorted((index, path) for index, path in ranked if index is not None)
