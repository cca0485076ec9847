"""Pictures of the whole window as PNG files, read from its framebuffer."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image


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
    """Write [H, W, 3] uint8 as PNG through a temporary file in the same folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".png.tmp")
    try:
        with os.fdopen(handle, "wb") as stream:
            Image.fromarray(image).save(stream, format="PNG")
        os.chmod(temporary, 0o644)  # mkstemp makes private files; a picture is meant to be looked at
        os.replace(temporary, path)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path
