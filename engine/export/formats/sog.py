"""The .sog of PlayCanvas, version 2: pictures in lossless WebP in which every pixel is a Gaussian, in a zip file."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import replace
from typing import Any, BinaryIO

import numpy as np

from engine.export.formats.damaged import damaged
from engine.export.formats.sog_pictures import attributes_of, member, pixels_of, splats_of, write_pictures
from engine.export.packing import morton_order
from engine.export.splats import Splats

_MOST_PIXELS = 1 << 27
_MOST_META_BYTES = 4 << 20
_MOST_MEMBER_BYTES = 1 << 31
_FAULTS = (
    *(zipfile.BadZipFile, zlib.error, OSError, EOFError),
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError),
)
"""Whatever a file leads into; RuntimeError is what zipfile and json raise where they give up."""


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Rows along a curve through space, which makes neighbouring pixels alike and the pictures small."""
    described, pixels = attributes_of(splats[morton_order(splats.means)])
    meta = {"version": 2, "asset": {"generator": "ClipGStream Studio"}} | described
    write_pictures(file, meta, pixels, len(splats))
    return ()


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`. Raises ProjectError where it is something else."""
    try:
        with zipfile.ZipFile(file) as archive:
            meta: dict[str, Any] = json.loads(member(archive, "meta.json", _MOST_META_BYTES))
            n = int(meta["count"])

            def pixels(name: str) -> np.ndarray:
                return pixels_of(member(archive, name, _MOST_MEMBER_BYTES), n, most_pixels=_MOST_PIXELS)

            degree = int(meta["shN"].get("bands", 3)) if "shN" in meta else 0
            return replace(splats_of(meta, pixels), sh_degree=degree)
    except _FAULTS as error:
        raise damaged(f"it is not a SOG file ({type(error).__name__})") from error
