"""Colour maps: values to colours that stay apart for the common kinds of colour blindness. Tables of 256 rows; numpy
only.

Each is made of a few control points, joined in the Oklab space. In the sequential ones lightness grows evenly from end
to end, so that equal steps of a value look equal and a grey print still reads; the signed one is lightest in the middle
and equally dark at both ends.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from engine.images.srgb import encoded_of, linear_of

N_COLORS = 256
SIGNED = "signed"
"""The map for values around zero: blue below, white at zero, orange above."""

_CONTROL_POINTS = {
    "inferno": "020208 260c52 6a166c b02e5a e45c2c faa41c fcfcaa",
    "viridis": "420656 403e84 2e6a8e 22948a 52be6e a8d83c fce628",
    SIGNED: "083878 2c7abe 8cbce4 f6f6f6 f4b86e ce7014 6e3004",
}
"""Red, green and blue as pairs of hexadecimal digits."""
_TO_LMS = np.array(
    [[0.4122215, 0.5363325, 0.0514460], [0.2119035, 0.6806995, 0.1073970], [0.0883025, 0.2817188, 0.6299787]]
)
_TO_LAB = np.array(
    [[0.2104543, 0.7936178, -0.0040720], [1.9779985, -2.4285922, 0.4505937], [0.0259040, 0.7827718, -0.8086758]]
)


def _to_oklab(colors: np.ndarray) -> np.ndarray:
    """Display-encoded RGB in 0..1 to Oklab. [n, 3]"""
    return np.cbrt(linear_of(colors) @ _TO_LMS.T) @ _TO_LAB.T


def _from_oklab(lab: np.ndarray) -> np.ndarray:
    """The inverse, cut to 0..1. [n, 3]"""
    return encoded_of(np.clip((lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T, 0.0, 1.0))


def _table(name: str) -> np.ndarray:
    lab = _to_oklab(np.array([list(bytes.fromhex(point)) for point in _CONTROL_POINTS[name].split()]) / 255.0)
    if name == SIGNED:  # both halves run evenly to the same lightness
        half, middle = len(lab) // 2, lab[len(lab) // 2, 0]
        lab[[0, -1], 0] = lab[[0, -1], 0].mean()
        steps = middle - lab[:, 0]
        places = np.concatenate([0.5 - 0.5 * steps[:half] / steps[0], [0.5], 0.5 + 0.5 * steps[half + 1 :] / steps[-1]])
    else:
        places = (lab[:, 0] - lab[0, 0]) / (lab[-1, 0] - lab[0, 0])  # where even lightness wants each of them
    at = np.linspace(0.0, 1.0, N_COLORS)
    joined = np.stack([np.interp(at, places, channel) for channel in lab.T], axis=1)
    table = np.round(_from_oklab(joined) * 255.0).astype(np.uint8)
    table.setflags(write=False)
    return table


def _gray() -> np.ndarray:
    table = np.repeat(np.arange(N_COLORS, dtype=np.uint8)[:, None], 3, axis=1)
    table.setflags(write=False)
    return table


COLOR_MAPS = MappingProxyType({name: _table(name) for name in _CONTROL_POINTS} | {"gray": _gray()})
"""[256, 3] uint8 each, from the low end of a range to the high one. Of "gray" the number itself can be read off."""


def mapped(
    values: np.ndarray, map_name: str, low: float, high: float, *, nothing: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Colours of values on a range; beyond its ends the colours of the ends.

    Args:
        values: [...]
        map_name: One of COLOR_MAPS.
        low, high: The range.
        nothing: Display-encoded RGB in 0..1 where a value is not a number.
    Returns:
        [..., 3] uint8
    Raises:
        ValueError: No such map, or not low < high.
    """
    if map_name not in COLOR_MAPS:
        raise ValueError(f"colour maps are {', '.join(COLOR_MAPS)}, not {map_name!r}")
    if not low < high:
        raise ValueError(f"a range of colours needs low < high, got {low} and {high}")
    values = np.asarray(values, dtype=np.float32)
    is_nothing = np.isnan(values)
    shares = np.clip((values - np.float32(low)) * np.float32(1.0 / (high - low)), 0.0, 1.0)
    rows = (np.where(is_nothing, 0.0, shares) * (N_COLORS - 1) + 0.5).astype(np.uint8)
    colors = COLOR_MAPS[map_name][rows]
    if is_nothing.any():
        colors[is_nothing] = np.round(np.array(nothing) * 255.0).astype(np.uint8)
    return colors
