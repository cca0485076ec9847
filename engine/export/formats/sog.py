"""The .sog of PlayCanvas, version 2: pictures in lossless WebP in which every pixel is a Gaussian, in a zip file."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

from engine.export.formats.codebook import codebook
from engine.export.formats.damaged import damaged
from engine.export.packing import as_levels, morton_order, quats_of_smaller_three, smaller_three
from engine.export.splats import Splats, colors_of

_MEANS, _SCALES, _QUATS, _COLORS = ("means_l.webp", "means_u.webp"), "scales.webp", "quats.webp", "sh0.webp"
_LONG_AGO = (1980, 1, 1, 0, 0, 0)
_FIRST_QUAT_TAG = 252
_MAX_SIDE = 16383
"""Of a WebP picture."""
_MAX_MEMBER_BYTES = 1 << 31


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Rows along a curve through space, which makes neighbouring pixels alike and the pictures small."""
    splats = splats[morton_order(splats.means)]
    n = len(splats)
    width = max(4, int(np.ceil(np.sqrt(n) / 4)) * 4)
    height = max(4, int(np.ceil(n / width / 4)) * 4)
    logs = np.sign(splats.means) * np.log1p(np.abs(splats.means.astype(np.float64)))
    low = logs.min(0) if n else np.zeros(3)
    high = logs.max(0) if n else np.zeros(3)
    positions = as_levels(np.divide(logs - low, high - low, out=np.zeros_like(logs), where=high > low), 16)
    scale_codes, scale_indices = codebook(np.log(splats.scales.astype(np.float64)))
    color_codes, color_indices = codebook(splats.f_dc)
    largest, three = smaller_three(splats.quats)
    opaque = np.full((n, 1), 255)
    pictures = {
        _MEANS[0]: np.concatenate([positions & 255, opaque], axis=1),
        _MEANS[1]: np.concatenate([positions >> 8, opaque], axis=1),
        _SCALES: np.concatenate([scale_indices, opaque], axis=1),
        _QUATS: np.concatenate([as_levels(three * np.sqrt(0.5) + 0.5), _FIRST_QUAT_TAG + largest[:, None]], axis=1),
        _COLORS: np.concatenate([color_indices, as_levels(splats.opacities)[:, None]], axis=1),
    }
    meta = {
        "version": 2,
        "asset": {"generator": "ClipGStream Studio"},
        "count": n,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": list(_MEANS)},
        "scales": {"codebook": scale_codes.tolist(), "files": [_SCALES]},
        "quats": {"files": [_QUATS]},
        "sh0": {"codebook": color_codes.tolist(), "files": [_COLORS]},
    }
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("meta.json", _LONG_AGO), json.dumps(meta, separators=(",", ":")))
        for name, pixels in pictures.items():
            archive.writestr(zipfile.ZipInfo(name, _LONG_AGO), _webp(pixels, width, height))
    return ()


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`. Raises ProjectError where it is something else."""
    try:
        with zipfile.ZipFile(file) as archive:
            meta: dict[str, Any] = json.loads(_member(archive, "meta.json"))
            n = int(meta["count"])
            lower, upper = (_pixels(archive, name, n) for name in meta["means"]["files"])
            scales, quats, colors = (_pixels(archive, meta[key]["files"][0], n) for key in ("scales", "quats", "sh0"))
            low, high = np.array(meta["means"]["mins"], float), np.array(meta["means"]["maxs"], float)
            scale_codes, color_codes = (np.array(meta[key]["codebook"], float) for key in ("scales", "sh0"))
            shares = (lower[:, :3] + 256.0 * upper[:, :3]) / 65535.0
            logs = low + shares * (high - low)
            return Splats(
                means=(np.sign(logs) * np.expm1(np.abs(logs))).astype(np.float32),
                quats=quats_of_smaller_three(
                    quats[:, 3].astype(np.int64) - _FIRST_QUAT_TAG, (quats[:, :3] / 255.0 * 2.0 - 1.0) * np.sqrt(0.5)
                ),
                scales=np.exp(scale_codes[scales[:, :3]]).astype(np.float32),
                opacities=colors[:, 3].astype(np.float32) / 255.0,
                colors=colors_of(color_codes[colors[:, :3]]),
                sh_degree=int(meta["shN"].get("bands", 3)) if "shN" in meta else 0,
            )
    except (zipfile.BadZipFile, OSError, EOFError, zlib.error, ValueError, KeyError, IndexError, TypeError) as error:
        raise damaged(f"it is not a SOG file ({type(error).__name__})") from error


def _webp(pixels: np.ndarray, width: int, height: int) -> bytes:
    picture = np.zeros((height * width, 4), np.uint8)
    picture[: len(pixels)] = pixels
    encoded = io.BytesIO()
    # method 0 is the fast one; exact keeps the colours of pixels whose alpha is 0
    Image.fromarray(picture.reshape(height, width, 4), "RGBA").save(
        encoded, "WEBP", lossless=True, quality=0, method=0, exact=True
    )
    return encoded.getvalue()


def _pixels(archive: zipfile.ZipFile, name: str, n: int) -> np.ndarray:
    with Image.open(io.BytesIO(_member(archive, name)), formats=["WEBP"]) as picture:
        if max(picture.size) > _MAX_SIDE:
            raise ValueError("too large")
        pixels = np.asarray(picture.convert("RGBA")).reshape(-1, 4)
    if len(pixels) < n:
        raise ValueError("too few pixels")
    return pixels[:n]


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    if archive.getinfo(name).file_size > _MAX_MEMBER_BYTES:
        raise ValueError("too large")
    return archive.read(name)
