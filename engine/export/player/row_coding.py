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
THINNEST_SHARE = 1e-3
"""A side thinner than this share of a usual Gaussian's size is stored as this thick: the low-pass hides both."""
QUAT_LEVELS = 127
"""The three smaller components of a rotation are rounded to so many steps on either side of zero."""
_MAX_POSITION = (1 << 16) - 1
_MAX_BYTE = 255


@dataclass(frozen=True, slots=True)
class Rounding:
    """How numbers become whole numbers.

    Attributes:
        origin: Of positions, scene units.
        step: Of positions, scene units.
        scale_low: Natural logarithm of the scale that 0 stands for.
        scale_step: Of natural logarithms of scales.
        color_max: Of colours: what 255 stands for, 1 or more.
    """

    origin: tuple[float, float, float]
    step: float
    scale_low: float
    scale_step: float
    color_max: float

    def described(self) -> dict[str, Any]:
        """As the page holds it."""
        return asdict(self)


def fitting_rounding(parts: Sequence[Splats]) -> Rounding:
    """The finest rounding that all of these fit into."""
    parts = [part for part in parts if len(part)]
    if not parts:
        return Rounding((0.0, 0.0, 0.0), 1.0, 0.0, 1.0, 1.0)
    low = np.min([part.means.min(0) for part in parts], axis=0).astype(np.float64)
    high = np.max([part.means.max(0) for part in parts], axis=0).astype(np.float64)
    usual = float(np.median(np.concatenate([part.scales.max(1) for part in parts])))
    largest = max(float(part.scales.max()) for part in parts)
    thinnest = max(min(float(part.scales.min()) for part in parts), THINNEST_SHARE * usual)
    step = max(float((high - low).max()) / _MAX_POSITION, POSITION_SHARE * usual)
    return Rounding(
        origin=(float(low[0]), float(low[1]), float(low[2])),
        step=step,
        scale_low=float(np.log(thinnest)),
        scale_step=max(float(np.log(largest / thinnest)) / _MAX_BYTE, 1e-6),
        color_max=color_max([part.colors for part in parts]),
    )


def color_max(colors: Sequence[np.ndarray]) -> float:
    """The brightness of 255 that lets all colours fit; a light on the scene can make them brighter than 1."""
    return max([1.0, *(float(part.max()) for part in colors if part.size)])


def rounded_colors(colors: np.ndarray, brightest: float) -> np.ndarray:
    """Colours as bytes. brightest: The brightness of 255. Same shape, uint8"""
    return np.floor(np.clip(colors / brightest, 0.0, 1.0) * _MAX_BYTE + 0.5).astype(np.uint8)


def encoded_rows(splats: Splats, rounding: Rounding) -> bytes:
    """17 bytes per row, as planes of differences; see the layout."""
    positions = np.floor((splats.means - np.array(rounding.origin)) / rounding.step + 0.5)
    largest, three = smaller_three(splats.quats)
    quats = np.floor(three * (np.sqrt(2.0) * QUAT_LEVELS) + (QUAT_LEVELS + 0.5))
    logs = np.log(np.maximum(splats.scales.astype(np.float64), np.exp(rounding.scale_low)))
    scales = np.floor((logs - rounding.scale_low) / rounding.scale_step + 0.5)
    opacities = np.floor(splats.opacities * _MAX_BYTE + 0.5)
    as_words = differences(np.clip(positions, 0, _MAX_POSITION).astype(np.uint16))
    as_bytes = np.concatenate(
        [
            largest[:, None].astype(np.uint8),
            quats.astype(np.uint8),
            np.clip(scales, 0, _MAX_BYTE).astype(np.uint8),
            opacities[:, None].astype(np.uint8),
            rounded_colors(splats.colors, rounding.color_max),
        ],
        axis=1,
    )
    planes = [(as_words & 255).astype(np.uint8), (as_words >> 8).astype(np.uint8), differences(as_bytes)]
    return b"".join(np.ascontiguousarray(plane.T).tobytes() for plane in planes)


def differences(values: np.ndarray) -> np.ndarray:
    """Each row less the row before it, the first one less zero, with signs folded in. [N, k] uint8 or uint16"""
    return folded(np.diff(values, axis=0, prepend=np.zeros_like(values[:1], shape=(1, *values.shape[1:]))))


def folded(steps: np.ndarray) -> np.ndarray:
    """Steps modulo 256 or 65536 as 0, -1, 1, -2, 2 ... counted from 0, so that small ones are small. Same dtype"""
    signed = steps.view(np.int16 if steps.dtype == np.uint16 else np.int8)
    return ((signed << 1) ^ (signed >> (8 * signed.itemsize - 1))).view(steps.dtype)
