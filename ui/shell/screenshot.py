"""Pictures of the whole window as PNG files, read from its framebuffer."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
from PIL import Image

from engine.storage.files import atomic_path


def read_window(ctx: moderngl.Context, width: int, height: int) -> np.ndarray:
    """The default framebuffer as [H, W, 3] uint8, top row first.

    Args:
        width, height: Framebuffer size in pixels; given because moderngl's own idea of it freezes at creation.
    """
    data = ctx.screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
    _ = ctx.error  # moderngl leaves a GL error pending here, which pyglet would raise at its next call
    image = np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3)
    return np.ascontiguousarray(image[::-1])


def write_png(image: np.ndarray, path: Path) -> Path:
    """Write [H, W, 3] uint8 as PNG; the file appears whole or not at all. Makes the folder."""
    with atomic_path(path) as partial:
        Image.fromarray(image).save(partial, format="PNG")
    return path
