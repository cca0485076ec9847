"""Rows of Gaussians as bytes: rounded to whole numbers, then as differences from row to row, property by property.

Neighbouring rows are often Gaussians of one anchor, so differences are small, and bytes of one kind that follow each
other deflate best. docs/player_format.md is the layout for readers of other programs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from engine.export.packing import smaller_three
from engine.export.splats import Splats

POSITION_SHARE = 0.02
"""Positions are rounded to this share of the size of a usual Gaussian, or coarser where 16 bits must span the scene."""
_MAX_POSITION = (1 << 16) - 1
_MAX_BYTE = 255
_LARGEST, _THREE, _SCALES, _OPACITY, _COLORS = 3, slice(4, 7), slice(7, 10), 10, slice(11, 14)
"""Columns of whole numbers; positions come first."""


@dataclass(frozen=True, slots=True)
class RowPrecision:
    """How finely rows are rounded.

    Attributes:
        position_share: Step of positions, as a share of the size of a usual Gaussian.
        thinnest_share: A side thinner than this share of it is stored as this thick: the low-pass hides both.
        quat_levels: Steps on either side of zero of the three smaller components of a rotation.
        scale_levels, opacity_levels, color_levels: Numbers go from 0 to these.
        held_steps: A number that is nearer to that of the frame before is kept; 0.5 only rounds. In steps.
    """

    position_share: float = POSITION_SHARE
    thinnest_share: float = 1e-3
    quat_levels: int = 127
    scale_levels: int = _MAX_BYTE
    opacity_levels: int = _MAX_BYTE
    color_levels: int = _MAX_BYTE
    held_steps: float = 0.5


FINE = RowPrecision()
COMPACT = RowPrecision(0.1, 1e-2, 31, 63, 63, 63, 0.8)
"""For what moves on a slow line: half the bytes of FINE, and pictures of the real capture still at 53 dB."""


@dataclass(frozen=True, slots=True)
class Rounding:
    """How numbers become whole numbers.

    Attributes:
        origin: Of positions, scene units.
        step: Of positions, scene units.
        scale_low: Natural logarithm of the scale that 0 stands for.
        scale_step: Of natural logarithms of scales.
        scale_levels: The number of the largest scale.
        quat_levels: See `RowPrecision`.
        opacity_levels: The number that stands for 1.
        color_levels: The number that stands for color_max.
        color_max: Of colours, 1 or more.
    """

    origin: tuple[float, float, float]
    step: float
    scale_low: float
    scale_step: float
    scale_levels: int = _MAX_BYTE
    quat_levels: int = 127
    opacity_levels: int = _MAX_BYTE
    color_levels: int = _MAX_BYTE
    color_max: float = 1.0

    def described(self) -> dict[str, Any]:
        """As the page holds it."""
        values = asdict(self)
        del values["scale_levels"]  # nobody needs it to read
        return values


def fitting_rounding(parts: Sequence[Splats], precision: RowPrecision = FINE) -> Rounding:
    """The finest rounding of this precision that all of these fit into."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return Rounding((0.0, 0.0, 0.0), 1.0, 0.0, 1.0)
    low = np.min([part.means.min(0) for part in parts], axis=0).astype(np.float64)
    high = np.max([part.means.max(0) for part in parts], axis=0).astype(np.float64)
    usual = float(np.median(np.concatenate([part.scales.max(1) for part in parts])))
    largest = max(float(part.scales.max()) for part in parts)
    thinnest = max(min(float(part.scales.min()) for part in parts), precision.thinnest_share * usual)
    step = max(float((high - low).max()) / _MAX_POSITION, precision.position_share * usual)
    return Rounding(
        origin=(float(low[0]), float(low[1]), float(low[2])),
        step=step,
        scale_low=float(np.log(thinnest)),
        scale_step=max(float(np.log(largest / thinnest)) / precision.scale_levels, 1e-6),
        scale_levels=precision.scale_levels,
        quat_levels=precision.quat_levels,
        opacity_levels=precision.opacity_levels,
        color_levels=precision.color_levels,
        color_max=color_max([part.colors for part in parts]),
    )


def color_max(colors: Sequence[np.ndarray]) -> float:
    """The brightness of 255 that lets all colours fit; a light on the scene can make them brighter than 1."""
    return max([1.0, *(float(part.max()) for part in colors if part.size)])


def rounded_colors(colors: np.ndarray, brightest: float) -> np.ndarray:
    """Colours as bytes. brightest: The brightness of 255. Same shape, uint8"""
    return np.floor(np.clip(colors / brightest, 0.0, 1.0) * _MAX_BYTE + 0.5).astype(np.uint8)


def in_steps(splats: Splats, rounding: Rounding) -> np.ndarray:
    """Rows in the steps of a rounding, before they are rounded: x, y, z, largest of the rotation, the three others,
    scales, opacity, colours. [N, 14] float64"""
    largest, three = smaller_three(splats.quats)
    logs = np.log(np.maximum(splats.scales.astype(np.float64), np.exp(rounding.scale_low)))
    columns = [
        np.clip((splats.means - np.array(rounding.origin)) / rounding.step, 0, _MAX_POSITION),
        largest[:, None],
        (three * np.sqrt(2.0) + 1.0) * rounding.quat_levels,
        np.clip((logs - rounding.scale_low) / rounding.scale_step, 0, rounding.scale_levels),
        splats.opacities[:, None].astype(np.float64) * rounding.opacity_levels,
        np.clip(splats.colors.astype(np.float64) / rounding.color_max, 0.0, 1.0) * rounding.color_levels,
    ]
    return np.concatenate(columns, axis=1, dtype=np.float64)


def rounded(steps: np.ndarray, before: np.ndarray | None = None, held_steps: float = 0.5) -> np.ndarray:
    """Whole numbers of rows. [N, 14] int64

    Args:
        steps: See `in_steps`.
        before: The same rows in the frame before, in whole numbers; None where there is none.
        held_steps: See `RowPrecision`.
    """
    values = np.floor(steps + 0.5).astype(np.int64)
    if before is not None:
        is_held = np.abs(steps - before) < held_steps
        is_held[:, _THREE] &= (values[:, _LARGEST] == before[:, _LARGEST])[:, None]
        is_held[:, _LARGEST] = False
        values = np.where(is_held, before, values)
    return values


def encoded_rows(splats: Splats, rounding: Rounding) -> bytes:
    """17 bytes per row, as planes of differences; see the layout."""
    return encoded_steps(np.diff(rounded(in_steps(splats, rounding)), axis=0, prepend=0))


def encoded_steps(steps: np.ndarray) -> bytes:
    """Differences of whole numbers as planes. [N, 14] int64"""
    words, small = folded(steps[:, :3].astype(np.uint16)), folded(steps[:, 3:].astype(np.uint8))
    planes = [(words & 255).astype(np.uint8), (words >> 8).astype(np.uint8), small]
    return b"".join(np.ascontiguousarray(plane.T).tobytes() for plane in planes)


def folded(steps: np.ndarray) -> np.ndarray:
    """Steps modulo 256 or 65536 as 0, -1, 1, -2, 2 ... counted from 0, so that small ones are small. Same dtype"""
    signed = steps.view(np.int16 if steps.dtype == np.uint16 else np.int8)
    return ((signed << 1) ^ (signed >> (8 * signed.itemsize - 1))).view(steps.dtype)
