"""How large the interface is drawn: pixels of the screen per unit in which panels measure. Knows no window.

Panels, fonts and spacing are given in units; one unit is one pixel on an ordinary screen. ImGui draws them at the
pixels of the screen, so letters are made at their real size and never stretched.
"""

from __future__ import annotations

import argparse
import math

CHOICES = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5)
MIN_UNITS = (880.0, 560.0)
"""A window that has room for fewer units than this shows everything smaller instead of cutting it off."""
SMALLEST = 0.5
LARGEST = 4.0


def parse_scale(text: str) -> float | None:
    """A scale as typed: "auto", "150%" or "1.5".

    Returns:
        None for automatic.
    Raises:
        argparse.ArgumentTypeError: It is none of these, or out of range.
    """
    plain = text.strip().lower()
    if plain in ("auto", "automatic"):
        return None
    try:
        scale = float(plain.removesuffix("%").strip()) / (100.0 if plain.endswith("%") else 1.0)
    except ValueError:
        scale = math.nan
    if not CHOICES[0] <= scale <= CHOICES[-1]:
        low, high = round(CHOICES[0] * 100), round(CHOICES[-1] * 100)
        raise argparse.ArgumentTypeError(f"'{text}' is not a scale: auto, or {low}% to {high}%, for example 150%")
    return scale


def scale_text(scale: float) -> str:
    """A scale as shown: "150 %"."""
    return f"{scale * 100:.0f} %"


def next_choice(scale: float, step: int) -> float:
    """The next larger or smaller choice; the last one stays where it is. step: 1 or -1."""
    if step > 0:
        return next((choice for choice in CHOICES if choice > scale + 1e-6), CHOICES[-1])
    return next((choice for choice in reversed(CHOICES) if choice < scale - 1e-6), CHOICES[0])


class UiScale:
    """The scale that was chosen, and the one that fits.

    Attributes:
        chosen: By the user; None follows the screen.
        of_screen: The platform's scale, 1 on an ordinary screen.
    """

    def __init__(self, chosen: float | None = None, *, of_screen: float = 1.0) -> None:
        self.chosen = chosen
        self.of_screen = min(max(of_screen, 1.0), LARGEST) if math.isfinite(of_screen) else 1.0

    @property
    def wanted(self) -> float:
        """Pixels per unit, where there is room for it."""
        return self.of_screen if self.chosen is None else self.chosen

    def fitting(self, width_px: float, height_px: float) -> float:
        """Pixels per unit in a window of this size."""
        room = min(width_px / MIN_UNITS[0], height_px / MIN_UNITS[1])
        return max(min(self.wanted, room), SMALLEST)
