"""Gaussians as rows of textures: the constant ones of a clip separate from those that change. Knows no GL."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from engine.conventions import ALPHA_MIN

SPLATS_PER_ROW = 1024
"""In rows of 3072 texels: below every driver's texture limit up to 16 million splats."""
_FIELDS = (("means", (3,)), ("quats", (4,)), ("scales", (3,)), ("opacities", ()), ("colors", (3,)))


class SplatArrays(Protocol):
    """Drawable Gaussians: the fields of engine.raster.Gaussians as numpy arrays, and a name for the contents.

    Attributes:
        means: Centres, world space, scene units. [N, 3]
        quats: Rotations wxyz, any non-zero length. [N, 4]
        scales: Standard deviations, scene units. [N, 3]
        opacities: In 0..1. [N]
        colors: Display-encoded RGB in 0..1. [N, 3]
        key: Differs whenever the arrays do; None when not known.
        n_still: So many rows come first and differ in nothing but their colours between arrays of one `still_key`.
        still_key: None where no rows are known to be so.
    """

    @property
    def means(self) -> np.ndarray: ...
    @property
    def quats(self) -> np.ndarray: ...
    @property
    def scales(self) -> np.ndarray: ...
    @property
    def opacities(self) -> np.ndarray: ...
    @property
    def colors(self) -> np.ndarray: ...
    @property
    def key(self) -> Hashable: ...
    @property
    def n_still(self) -> int: ...
    @property
    def still_key(self) -> Hashable: ...


@dataclass(frozen=True, slots=True, eq=False)
class SplatRows:
    """Rows that can be seen, as the texels that the shader reads. float32

    Attributes:
        geometry: mean, opacity | quat wxyz | scale, 0. [n, 12]
        colors: color, 0. [n, 4]
        kept: Which of the given rows these are; None for all of them. [n] int64
    """

    geometry: np.ndarray
    colors: np.ndarray
    kept: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.geometry)


@dataclass(frozen=True, slots=True, eq=False)
class PackedSplats:
    """One set of Gaussians, ready for the graphics card.

    Attributes:
        arrays: Its source.
        still, moving: Its rows. Those that move begin in a row of the texture of their own.
        still_key: See SplatArrays; None where no rows stand still.
        means: Centres by row of the textures; not a number where a row is empty. [rows, 3] float32
    """

    arrays: SplatArrays
    still: SplatRows
    moving: SplatRows
    still_key: Hashable
    means: np.ndarray

    def __len__(self) -> int:
        """Rows that can be seen."""
        return len(self.still) + len(self.moving)

    @property
    def n_dropped(self) -> int:
        """Rows that were left out: not finite, no rotation, or too faint to pass ALPHA_MIN."""
        return len(self.arrays.means) - len(self)

    @property
    def first_moving_row(self) -> int:
        """Row of the textures at which the moving ones begin."""
        return -(-len(self.still) // SPLATS_PER_ROW)


def pack_splats(arrays: SplatArrays, before: PackedSplats | None = None) -> PackedSplats:
    """Rows that can be seen, in the given order.

    Args:
        before: Of which what stands still is taken over, if it is the same.
    Raises:
        ValueError: Shapes do not belong together.
    """
    n = len(arrays.means)
    for name, width in _FIELDS:
        if np.shape(getattr(arrays, name)) != (n, *width):
            raise ValueError(f"{name} must have shape {(n, *width)}, got {np.shape(getattr(arrays, name))}")
    n_still = min(arrays.n_still, n) if arrays.still_key is not None else 0
    still, still_key = None, arrays.still_key if n_still else None
    if before is not None and still_key is not None and before.still_key == still_key:
        still = _in_other_colors(before.still, arrays.colors[:n_still])
    if still is None:
        still = _pack(arrays, slice(0, n_still))
        if not np.isfinite(arrays.colors[:n_still]).all():  # in another frame other rows may be left out
            still_key = None
    moving = _pack(arrays, slice(n_still, n))
    gap = -len(still) % SPLATS_PER_ROW if len(moving) else 0
    nothing = np.full((gap, 3), np.nan, np.float32)
    means = np.concatenate([still.geometry[:, :3], nothing, moving.geometry[:, :3]])
    return PackedSplats(arrays, still, moving, still_key, means)


def _pack(arrays: SplatArrays, rows: slice) -> SplatRows:
    n = len(arrays.means[rows])
    geometry, colors = np.zeros((n, 12), np.float32), np.zeros((n, 4), np.float32)
    geometry[:, 0:3] = arrays.means[rows]
    geometry[:, 3] = arrays.opacities[rows]
    geometry[:, 4:8] = arrays.quats[rows]
    geometry[:, 8:11] = arrays.scales[rows]
    colors[:, :3] = arrays.colors[rows]
    is_finite = np.isfinite(geometry).all(axis=1) & np.isfinite(colors).all(axis=1)
    is_seen = is_finite & (geometry[:, 3] > ALPHA_MIN) & geometry[:, 4:8].any(axis=1)
    if is_seen.all():
        return SplatRows(geometry, colors)
    kept = np.flatnonzero(is_seen)
    return SplatRows(geometry[kept], colors[kept], kept)


def _in_other_colors(rows: SplatRows, colors: np.ndarray) -> SplatRows | None:
    """The same rows; None where a colour is not finite, so that other rows are seen."""
    taken = colors if rows.kept is None else colors[rows.kept]
    if taken.shape[0] != len(rows) or not np.isfinite(colors).all():
        return None
    if np.array_equal(rows.colors[:, :3], taken):
        return rows
    packed = np.zeros((len(rows), 4), np.float32)
    packed[:, :3] = taken
    return SplatRows(rows.geometry, packed, rows.kept)
