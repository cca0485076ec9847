"""The masks and points that came along with a capture, as a key: results made with them do not outlive others."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames
from engine.capture.layout.format_result import Layout

N_LOOKED_AT = 3
"""Masks of a camera whose bytes are looked at: the first, the middle and the last."""
PIECE_BYTES = 64 << 10
"""Of a file its beginning, middle and end are looked at, this much of each."""


def came_along(layout: Layout) -> dict[str, Any]:
    """The part of a cache key that stands for a capture's masks and points; empty where nothing came along.

    Names, sizes and samples of the contents, not the times of files: a copied capture has the same key. Reads a few
    small pieces of files, whatever their size.

    Returns:
        JSON-able: "masks", a text of each camera that has some, and "points", a text.
    """
    masks = {camera.name: _masks_key(camera.masks) for camera in layout.cameras if camera.masks is not None}
    found: dict[str, Any] = {"masks": masks} if masks else {}
    if layout.points is not None:
        placed = None if layout.points_to_world is None else layout.points_to_world.tolist()
        found["points"] = _short(_file_key(layout.points), repr(placed))
    return found


def _masks_key(masks: FrameSource) -> str:
    source, order = masks, ""
    if isinstance(masks, IndexedFrames):
        source, order = masks.source, masks.frame_indices.tobytes().hex()
    if not isinstance(source, ImageFrames):
        return _short(str(source.n_frames), order, _file_key(source.path))
    n_files = len(source.files)
    looked_at = sorted({i * (n_files - 1) // (N_LOOKED_AT - 1) for i in range(N_LOOKED_AT)})
    names = "\0".join(path.name for path in source.files)
    return _short(names, order, *(_file_key(source.files[index]) for index in looked_at))


def _file_key(path: Path) -> str:
    """Of a file's name, size and parts of its contents; of the name alone where it cannot be read."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            n_bytes = file.seek(0, os.SEEK_END)
            for start in sorted({0, max((n_bytes - PIECE_BYTES) // 2, 0), max(n_bytes - PIECE_BYTES, 0)}):
                file.seek(start)
                digest.update(file.read(PIECE_BYTES))
    except OSError:  # said where it is used
        n_bytes = -1
    return _short(path.name, str(n_bytes), digest.hexdigest())


def _short(*parts: str) -> str:
    """16 hex digits of texts, which may be any file names."""
    return hashlib.sha256(repr(parts).encode("utf-8", "backslashreplace")).hexdigest()[:16]
