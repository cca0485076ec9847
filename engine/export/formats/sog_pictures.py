"""The pictures of .sog and .tsog: lossless WebP in which every pixel is a Gaussian, in a zip file with a document."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Iterable, Mapping
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

from engine.export.formats.codebook import codebook
from engine.export.packing import as_levels, quats_of_smaller_three, smaller_three
from engine.export.splats import Splats, colors_of

_MEANS, _SCALES, _QUATS, _COLORS = ("means_l.webp", "means_u.webp"), "scales.webp", "quats.webp", "sh0.webp"
_LONG_AGO = (1980, 1, 1, 0, 0, 0)
_FIRST_QUAT_TAG = 252
_LOSSLESS_MARK = 0x2F
_NOT_LOSSLESS = {b"VP8 ", b"ALPH", b"ANIM", b"ANMF"}


def attributes_of(splats: Splats) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What the document of a file says of the Gaussians, and their pixels by the name of the picture: [N, 3 or 4]."""
    n = len(splats)
    logs = np.sign(splats.means) * np.log1p(np.abs(splats.means.astype(np.float64)))
    low = logs.min(0) if n else np.zeros(3)
    high = logs.max(0) if n else np.zeros(3)
    positions = as_levels(np.divide(logs - low, high - low, out=np.zeros_like(logs), where=high > low), 16)
    scale_codes, scale_indices = codebook(np.log(splats.scales.astype(np.float64)))
    color_codes, color_indices = codebook(splats.f_dc)
    largest, three = smaller_three(splats.quats)
    pixels = dict(zip(_MEANS, bytes_of(positions), strict=True)) | {
        _SCALES: scale_indices,
        _QUATS: np.concatenate([as_levels(three * np.sqrt(0.5) + 0.5), _FIRST_QUAT_TAG + largest[:, None]], axis=1),
        _COLORS: np.concatenate([color_indices, as_levels(splats.opacities)[:, None]], axis=1),
    }
    described = {
        "count": n,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": list(_MEANS)},
        "scales": {"codebook": scale_codes.tolist(), "files": [_SCALES]},
        "quats": {"files": [_QUATS]},
        "sh0": {"codebook": color_codes.tolist(), "files": [_COLORS]},
    }
    return described, {name: values.astype(np.uint8) for name, values in pixels.items()}


def splats_of(meta: Mapping[str, Any], pixels: Callable[[str], np.ndarray]) -> Splats:
    """The inverse of `attributes_of`, of those rows that `pixels` has of a picture: [N, 4].

    Raises:
        KeyError, IndexError, TypeError, ValueError: The document is another one.
    """
    lower, upper = (pixels(name) for name in meta["means"]["files"])
    scales, quats, colors = (pixels(meta[key]["files"][0]) for key in ("scales", "quats", "sh0"))
    scale_codes, color_codes = (np.array(meta[key]["codebook"], float) for key in ("scales", "sh0"))
    if (quats[:, 3] < _FIRST_QUAT_TAG).any():
        raise ValueError("a rotation without the number of its largest component")
    logs = between(meta["means"]["mins"], meta["means"]["maxs"], shares(lower[:, :3], upper[:, :3]))
    return Splats(
        means=(np.sign(logs) * np.expm1(np.abs(logs))).astype(np.float32),
        quats=quats_of_smaller_three(
            quats[:, 3].astype(np.int64) - _FIRST_QUAT_TAG, (quats[:, :3] / 255.0 * 2.0 - 1.0) * np.sqrt(0.5)
        ),
        scales=np.exp(scale_codes[scales[:, :3]]).astype(np.float32),
        opacities=colors[:, 3].astype(np.float32) / 255.0,
        colors=colors_of(color_codes[colors[:, :3]]),
    )


def bytes_of(levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bytes of numbers of 16 bits."""
    return levels & 255, levels >> 8


def shares(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Numbers of 16 bits by their bytes, as parts of the largest one. float64"""
    return (lower + 256.0 * upper) / 65535.0


def between(low: Iterable[float], high: Iterable[float], share: np.ndarray) -> np.ndarray:
    """Values that lie so far from the low to the high ones. The last axis is theirs."""
    lows, highs = np.array(low, float), np.array(high, float)
    return lows + share * (highs - lows)


def write_pictures(
    file: BinaryIO,
    meta: Mapping[str, Any],
    pixels: Mapping[str, np.ndarray],
    n: int,
    *,
    effort: int = 0,
    others: Mapping[str, Iterable[bytes]] | None = None,
) -> None:
    """A zip file with the document and its pictures, which are packed already and stored as they are; without dates, so
    that equal scenes are equal files.

    Args:
        pixels: By the name of the picture. [n, 1 to 4] each
        effort: 0 to 100: 50 makes pictures a fifth smaller and takes four times as long.
        others: Further files by their names, in pieces.
    """
    width = max(4, int(np.ceil(np.sqrt(n) / 4)) * 4)
    height = max(4, int(np.ceil(n / width / 4)) * 4)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("meta.json", _LONG_AGO), json.dumps(meta, separators=(",", ":")))
        for name, values in pixels.items():
            archive.writestr(zipfile.ZipInfo(name, _LONG_AGO), _webp(values, width, height, effort))
        for name, pieces in (others or {}).items():
            with archive.open(zipfile.ZipInfo(name, _LONG_AGO), "w") as other:
                for piece in pieces:
                    other.write(piece)


def _webp(values: np.ndarray, width: int, height: int, effort: int) -> bytes:
    picture = np.zeros((height * width, 4), np.uint8)
    picture[: len(values), : values.shape[1]] = values
    picture[: len(values), values.shape[1] :] = (0, 0, 0, 255)[values.shape[1] :]
    encoded = io.BytesIO()
    # method 0 is the fast one; exact keeps the colours of pixels whose alpha is 0
    Image.fromarray(picture.reshape(height, width, 4), "RGBA").save(
        encoded, "WEBP", lossless=True, quality=effort, method=4 if effort else 0, exact=True
    )
    return encoded.getvalue()


def pixels_of(data: bytes, n: int, *, most_pixels: int) -> np.ndarray:
    """The pixels of a picture, row by row. [n, 4] uint8

    Raises:
        ValueError: It is not a lossless WebP picture, is damaged, has fewer pixels than n, or more than the limit; then
            nothing of it was decoded.
    """
    width, height = webp_size(data)
    if width * height < n:
        raise ValueError("too few pixels")
    if width * height > most_pixels:
        raise ValueError("too many pixels")
    try:
        with Image.open(io.BytesIO(data), formats=["WEBP"]) as picture:
            if picture.size != (width, height):
                raise ValueError("two sizes")
            return np.asarray(picture.convert("RGBA")).reshape(-1, 4)[:n]
    except OSError as error:
        raise ValueError("a damaged picture") from error


def webp_size(data: bytes) -> tuple[int, int]:
    """Width and height of a lossless WebP picture that does not move, from its head. Raises ValueError otherwise."""
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP":
        raise ValueError("not a WebP picture")
    at = 12
    while at + 13 <= len(data) and data[at : at + 4] not in _NOT_LOSSLESS:
        if data[at : at + 4] == b"VP8L":
            bits = int.from_bytes(data[at + 9 : at + 13], "little")
            if data[at + 8] != _LOSSLESS_MARK:
                break
            return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
        n_bytes = int.from_bytes(data[at + 4 : at + 8], "little")
        at += 8 + n_bytes + n_bytes % 2
    raise ValueError("not a lossless WebP picture")


def member(archive: zipfile.ZipFile, name: str, most_bytes: int) -> bytes:
    """A file of the zip file.

    Raises:
        KeyError: It is missing.
        ValueError: It is larger than the limit, or packed in a way that these formats do not have.
    """
    info = archive.getinfo(name)
    if info.file_size > most_bytes:
        raise ValueError("too large")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("packed in another way")
    return archive.read(info)
