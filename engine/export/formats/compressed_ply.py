"""The compressed .ply of PlayCanvas: 16 bytes per Gaussian, between the smallest and the largest of 256 neighbours."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from engine.export.formats.damaged import damaged
from engine.export.formats.ply import header, read_header, read_rows
from engine.export.packing import as_levels, morton_order, quats_of_smaller_three, smaller_three
from engine.export.splats import Splats

CHUNK = 256
"""Gaussians that share their limits."""
_CHUNK_COLUMNS = tuple(
    f"{end}_{name}"
    for names in (("x", "y", "z"), ("scale_x", "scale_y", "scale_z"), ("r", "g", "b"))
    for end in ("min", "max")
    for name in names
)
_COLUMNS = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
_MAX_LN_SCALE = 20.0


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Rows along a curve through space, so that the 256 of a chunk are near each other."""
    splats = splats[morton_order(splats.means)]
    ln_scales = np.clip(np.log(splats.scales.astype(np.float64)), -_MAX_LN_SCALE, _MAX_LN_SCALE)
    limits, shares = [], []
    for values in (splats.means, ln_scales, splats.colors):
        low, high = _limits(values)
        limits += [low, high]
        shares.append(_shares(values.astype(np.float64), low, high))
    position, scale, color = shares
    largest, three = smaller_three(splats.quats)
    rotation = as_levels(three * np.sqrt(0.5) + 0.5, 10)
    packed = np.empty((len(splats), 4), "<u4")
    packed[:, 0] = _packed_11_10_11(position)
    packed[:, 1] = (largest.astype(np.uint32) << 30) | (rotation[:, 0] << 20) | (rotation[:, 1] << 10) | rotation[:, 2]
    packed[:, 2] = _packed_11_10_11(scale)
    red, green, blue = as_levels(color).T
    packed[:, 3] = (red << 24) | (green << 16) | (blue << 8) | as_levels(splats.opacities)
    chunks = np.concatenate(limits, axis=1).astype("<f4")
    file.write(header({"chunk": (len(chunks), "float", _CHUNK_COLUMNS), "vertex": (len(packed), "uint", _COLUMNS)}))
    file.write(chunks.tobytes())
    file.write(packed.tobytes())
    return ()


def is_compressed(head: bytes) -> bool:
    """Whether a .ply that begins so is of this kind."""
    return b"\nelement chunk " in head


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`, or one of another program, which may lack limits of colours and have colours of higher
    degrees. Raises ProjectError where it is something else."""
    elements = read_header(file)
    limits = tuple(elements["chunk"].columns) if "chunk" in elements else ()
    is_known = list(elements)[:2] == ["chunk", "vertex"] and tuple(elements["vertex"].columns) == _COLUMNS
    if not is_known or limits not in (_CHUNK_COLUMNS, _CHUNK_COLUMNS[:12]):
        raise damaged("it is not a compressed PLY file")
    n_chunks, n = elements["chunk"].n_rows, elements["vertex"].n_rows
    if n_chunks != -(-n // CHUNK):
        raise damaged(f"it has {n_chunks} chunks for {n} Gaussians")
    chunks = np.tile(np.repeat([0.0, 1.0], 3), (n_chunks, 3)).reshape(n_chunks, 3, 2, 3)
    rows = read_rows(file, elements["chunk"])
    chunks.reshape(n_chunks, 18)[:, : len(limits)] = np.stack([rows[name] for name in limits], axis=1)
    packed = read_rows(file, elements["vertex"])
    position, rotation, scale, color = (packed[name] for name in _COLUMNS)
    bytes_ = np.stack([(color >> shift) & 255 for shift in (24, 16, 8)], axis=1) / 255.0
    three = np.stack([(rotation >> shift) & 1023 for shift in (20, 10, 0)], axis=1) / 1023.0
    return Splats(
        means=_between(chunks[:, 0], _unpacked_11_10_11(position)).astype(np.float32),
        quats=quats_of_smaller_three((rotation >> 30).astype(np.int64), (three - 0.5) * np.sqrt(2.0)),
        scales=np.exp(_between(chunks[:, 1], _unpacked_11_10_11(scale))).astype(np.float32),
        opacities=((color & 255) / 255.0).astype(np.float32),
        colors=_between(chunks[:, 2], bytes_).astype(np.float32),
        sh_degree=round((len(elements["sh"].columns) / 3 + 1) ** 0.5) - 1 if "sh" in elements else 0,
    )


def _limits(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value of every chunk, as float32 will have them. [chunks, 3] each"""
    starts = np.arange(0, len(values), CHUNK)
    if not len(starts):
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return low.astype(np.float32), high.astype(np.float32)


def _shares(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where values lie between the limits of their chunk, 0..1; 0 where there is nothing between."""
    chunk = np.arange(len(values)) // CHUNK
    low, extent = low.astype(np.float64)[chunk], (high.astype(np.float64) - low)[chunk]
    return np.divide(values - low, extent, out=np.zeros_like(values), where=extent > 0.0)


def _between(limits: np.ndarray, shares: np.ndarray) -> np.ndarray:
    low, high = limits[np.arange(len(shares)) // CHUNK].transpose(1, 0, 2)
    return low * (1.0 - shares) + high * shares


def _packed_11_10_11(shares: np.ndarray) -> np.ndarray:
    x, y, z = shares.T
    return (as_levels(x, 11) << 21) | (as_levels(y, 10) << 11) | as_levels(z, 11)


def _unpacked_11_10_11(packed: np.ndarray) -> np.ndarray:
    return np.stack([(packed >> 21) / 2047.0, ((packed >> 11) & 1023) / 1023.0, (packed & 2047) / 2047.0], axis=1)
