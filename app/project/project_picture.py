"""The small picture of a project that the first screen shows: a JPEG in the user's cache folder, under a name made from
the project's path, so that a project that may only be read has one, too.
"""

from __future__ import annotations

import hashlib
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

from engine.storage.files import atomic_path, read_bytes
from engine.user_folders import cache_dir

SIZE = (320, 180)
"""Width and height, px."""
MAX_BYTES = 1 << 20


def picture_path(folder: Path) -> Path:
    """Where the picture of a project, or of a capture without one, lies. folder: Absolute."""
    name = hashlib.sha256(str(folder).encode("utf-8", "surrogateescape")).hexdigest()[:24]
    return cache_dir() / "projects" / f"{name}.jpg"


def write_picture(folder: Path, image: np.ndarray) -> None:
    """Keep a picture of a project, cut to the shape of SIZE; the file appears whole or not at all.

    Args:
        image: [H, W, 3] uint8.
    Raises:
        OSError: The disk refused.
    """
    with atomic_path(picture_path(folder)) as partial:
        Image.fromarray(fitted(image)).save(partial, format="JPEG", quality=88)


def read_picture(folder: Path) -> np.ndarray | None:
    """The picture of a project, [H, W, 3] uint8; None where there is none that can be read."""
    try:
        data = read_bytes(picture_path(folder), max_bytes=MAX_BYTES)
        with Image.open(BytesIO(data), formats=["JPEG"]) as stored:
            if stored.size != SIZE:
                return None
            return np.ascontiguousarray(stored.convert("RGB"))
    except (OSError, ValueError, SyntaxError):  # PIL raises each of them for damaged files
        return None


def fitted(image: np.ndarray) -> np.ndarray:
    """The largest middle part of an image in the shape of SIZE, at that size. [180, 320, 3] uint8"""
    height, width = image.shape[:2]
    scale = min(width / SIZE[0], height / SIZE[1])
    part = (max(round(SIZE[0] * scale), 1), max(round(SIZE[1] * scale), 1))
    left, top = (width - part[0]) // 2, (height - part[1]) // 2
    box = (left, top, left + part[0], top + part[1])
    return np.asarray(Image.fromarray(image).resize(SIZE, Image.Resampling.BOX, box=box))
