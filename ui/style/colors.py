"""Hues that carry meaning, once for the widgets and the GL drawing alike. Plain numbers; imports no library.

They come from the Okabe-Ito set, which stays apart for the common kinds of colour blindness; every one of them is also
told apart by a shape, an icon or a word where it is used.
"""

from __future__ import annotations

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity in 0..1."""


def rgb(r: int, g: int, b: int, alpha: float = 1.0) -> Color:
    """An 8-bit colour as floats in 0..1."""
    return (r / 255.0, g / 255.0, b / 255.0, alpha)


SKY = rgb(86, 180, 233)
ORANGE = rgb(230, 159, 0)
GREEN = rgb(0, 158, 115)
YELLOW = rgb(240, 228, 66)
VERMILLION = rgb(213, 94, 0)
PURPLE = rgb(204, 121, 167)

INHERITED = SKY
"""Inherited anchors; drawn as circles."""
RESIDUAL = ORANGE
"""Residual anchors; drawn as diamonds."""
ROLE_COLORS = {
    "static": SKY,
    "moving": GREEN,
    "promoted": VERMILLION,
    "residual": ORANGE,
    "adapted": GREEN,
    "replacing": VERMILLION,
}
"""Anchors by what they are (engine.clip_files.roles). Adapted and replacing ones are moving and promoted ones of one
clip, drawn as diamonds."""
REGION_COLORS = {"static": SKY, "dynamic": VERMILLION}
"""Regions that the user marks, like the anchors they make; drawn with whole lines and with dashes."""
HELD_OUT = PURPLE
"""Cameras that training never sees."""
CHOSEN = YELLOW
"""The camera that is looked through, and anchors in a region that is being chosen."""
