"""Pixels of a target back in main memory."""

from __future__ import annotations

import numpy as np

from ui.gl.targets import Target


def read_color(target: Target) -> np.ndarray:
    """Premultiplied RGBA as drawn. [H, W, 4] float32"""
    width, height = target.size
    raw = target.framebuffer.read(components=4, dtype="f4")
    return np.frombuffer(raw, dtype=np.float32).reshape(height, width, 4)


def read_resolved(target: Target) -> np.ndarray:
    """The picture of the last resolve() without its alpha. [H, W, 3] uint8"""
    width, height = target.size
    return np.frombuffer(target.texture.read(), dtype=np.uint8).reshape(height, width, 4)[..., :3]
