"""Sequences: one PNG or OpenEXR file per picture."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from app.export.jobs.video import PassName
from app.export.video.passes import PassPicture
from engine.export.exr import write_exr
from engine.images.srgb import linear_of

MAX_LEVEL = 65_535
NOTHING_DEPTH = 1e10
"""Depth in OpenEXR where nothing is: far away, as compositing programs expect it."""


def depth_unit(reach: float) -> float:
    """Scene units per level of a 16-bit picture of depths: 1, 2 or 5 times a power of ten, so that `reach` fits."""
    least = reach / MAX_LEVEL
    power = 10.0 ** math.floor(math.log10(least))
    return float(next(f"{step * power:.0e}" for step in (1, 2, 5, 10) if step * power >= least))


def write_png(path: Path, picture: PassPicture, *, background: tuple[int, int, int], is_transparent: bool) -> None:
    """Write colours with 8 bits a channel, and opacity where it is asked for. Raises OSError."""
    image = picture.straight() if is_transparent else picture.over(background)
    Image.fromarray(image).save(path, format="PNG", compress_level=4)


def write_depth_png(path: Path, picture: PassPicture, *, unit: float) -> None:
    """Write depths in 16 bits: level = depth / unit rounded, 0 where nothing is. The unit is in the file, too.

    Raises:
        OSError: The disk refused.
    """
    assert picture.values is not None
    levels = np.nan_to_num(np.clip(np.round(picture.values / unit), 1, MAX_LEVEL)).astype(np.uint16)
    about = PngInfo()
    about.add_text("Depth", f"1 level = {unit:g} scene units along the viewing axis; 0: nothing there")
    Image.fromarray(levels).save(path, format="PNG", compress_level=4, pnginfo=about)


def write_exr_picture(path: Path, picture: PassPicture, shows: PassName) -> None:
    """Write numbers: linear R, G, B, A and the depth Z of pictures in colour, Z of depths, Y of anything else.

    Raises:
        OSError: The disk refused.
    """
    values = picture.values
    assert values is not None
    if shows in ("color", "depth"):
        values = np.where(np.isnan(values), np.float32(NOTHING_DEPTH), values)
    if shows != "color":
        write_exr(path, {"Z" if shows == "depth" else "Y": values})
        return
    alpha = picture.alpha
    linear = linear_of(picture.color / np.maximum(alpha, 1e-6)[..., None]) * alpha[..., None]
    channels = {name: linear[..., row].astype(np.float16) for row, name in enumerate("RGB")}
    write_exr(path, {**channels, "A": alpha.astype(np.float16), "Z": values})
