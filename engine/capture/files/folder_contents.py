"""The contents of a folder that could not be opened as a capture, in the words of the message that says so."""

from __future__ import annotations

import os
from collections import Counter
from itertools import islice
from pathlib import Path

MAX_LOOKED_AT = 20_000
"""Entries of a folder that are counted."""
_KINDS = {
    "video": (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm", ".mts", ".ts", ".mpg", ".mxf"),
    "image": (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".exr"),
    "JSON file": (".json",),
    "TOML file": (".toml",),
    "YAML file": (".yml", ".yaml"),
}
_KIND_OF = {suffix: kind for kind, suffixes in _KINDS.items() for suffix in suffixes}
_ORDER = (*_KINDS, "other file", "folder")


def folder_contents(folder: Path) -> str:
    """Counts by kind, as "4 videos, 1 TOML file and 2 folders". Raises OSError when the folder cannot be read."""
    with os.scandir(folder) as entries:
        kinds = Counter(_kind(entry) for entry in islice(entries, MAX_LOOKED_AT))
    if not kinds:
        return "nothing"
    counts = [f"{kinds[kind]:,} {kind}{'s' if kinds[kind] > 1 else ''}" for kind in _ORDER if kinds[kind]]
    text = counts[0] if len(counts) == 1 else f"{', '.join(counts[:-1])} and {counts[-1]}"
    return f"{text} among its first {MAX_LOOKED_AT:,} entries" if kinds.total() == MAX_LOOKED_AT else text


def _kind(entry: os.DirEntry[str]) -> str:
    try:
        is_folder = entry.is_dir()
    except OSError:  # a link to itself
        is_folder = False
    return "folder" if is_folder else _KIND_OF.get(os.path.splitext(entry.name)[1].lower(), "other file")
