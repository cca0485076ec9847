"""Hues that carry meaning, once for the widgets and the GL drawing alike. Plain numbers; imports no library.

They are those of app.playback.modes.hues; every one of them also has a shape, an icon or a word of its own where it
is used.
"""

from __future__ import annotations

from app.playback.modes import hues

Color = tuple[float, float, float, float]
"""Red, green, blue and opacity in 0..1."""


def rgb(r: int, g: int, b: int, alpha: float = 1.0) -> Color:
    """An 8-bit colour as floats in 0..1."""
    return (r / 255.0, g / 255.0, b / 255.0, alpha)


SKY: Color = (*hues.SKY, 1.0)
ORANGE: Color = (*hues.ORANGE, 1.0)
GREEN: Color = (*hues.GREEN, 1.0)
YELLOW: Color = (*hues.YELLOW, 1.0)
VERMILLION: Color = (*hues.VERMILLION, 1.0)
PURPLE: Color = (*hues.PURPLE, 1.0)

INHERITED = SKY
"""Inherited anchors; drawn as circles."""
RESIDUAL = ORANGE
"""Residual anchors; drawn as diamonds."""
ROLE_COLORS: dict[str, Color] = {role: (*hue, 1.0) for role, hue in hues.ROLE_HUES.items()}
"""Anchors by role; those that one clip alone has are drawn as diamonds."""
REGION_COLORS = {"static": SKY, "dynamic": VERMILLION}
"""Regions that the user marks, like the anchors they make; drawn with whole lines and with dashes."""
HELD_OUT = PURPLE
"""Cameras that training never sees."""
PATH: Color = rgb(64, 201, 143)
"""The camera path that is edited; its keys are diamonds."""
CHOSEN = YELLOW
"""The camera that is looked through, and anchors in a region that is being chosen."""
