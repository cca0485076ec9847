"""Hues that carry meaning, for pictures and for the window alike: red, green and blue in 0..1.

They come from the Okabe-Ito set, which stays apart for the common kinds of colour blindness.
"""

from __future__ import annotations

Hue = tuple[float, float, float]
"""Red, green and blue in 0..1."""


def hue(r: int, g: int, b: int) -> Hue:
    """An 8-bit colour as floats in 0..1."""
    return r / 255.0, g / 255.0, b / 255.0


SKY = hue(86, 180, 233)
ORANGE = hue(230, 159, 0)
GREEN = hue(0, 158, 115)
YELLOW = hue(240, 228, 66)
VERMILLION = hue(213, 94, 0)
PURPLE = hue(204, 121, 167)

ROLE_HUES = {
    "static": SKY,
    "moving": GREEN,
    "promoted": VERMILLION,
    "residual": ORANGE,
    "adapted": GREEN,
    "replacing": VERMILLION,
}
"""Anchors by role (engine.clip_files.roles). Adapted and replacing ones are moving and promoted ones of one
clip."""
