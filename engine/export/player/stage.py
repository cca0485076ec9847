"""Where somebody in a headset stands in a scene: on its ground, and how large it is around them."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from engine.export.splats import Splats

PERSON_M = 1.7
"""What moves is taken to be so tall where the length of a scene unit is not known."""
CAMERAS_M = 2.5
"""Where that says nothing, cameras are taken to be so far from what they look at."""
FARTHEST_CAMERAS_M = 10.0
"""If a person's height puts them farther away, what moves is too flat or too small for a person."""
FEWEST_MOVING = 50
"""Gaussians; fewer are chance."""
ENDS_PERCENT = 2.0
"""Of the Gaussians at either end are left out of a height."""


class Stage(TypedDict):
    """How a player sets up a scene around a headset.

    Attributes:
        floor: How far up the ground is: a coordinate along the scene's up direction, scene units.
        meters_per_unit: Length of a scene unit, m.
        is_measured: Whether that was set by the user; otherwise it is a guess from the height of what moves, or from
            the cameras where that is not a person's.
    """

    floor: float
    meters_per_unit: float
    is_measured: bool


def stage_of(
    still: Splats,
    moving: Splats,
    *,
    up: np.ndarray,
    focus: np.ndarray,
    radius: float,
    meters_per_unit: float | None = None,
) -> Stage:
    """Set up a scene by one of its frames: the ground is below the feet of what moves, or below still parts where
    nothing does.

    Args:
        still, moving: Gaussians of a frame.
        up: Unit vector. [3]
        focus: What cameras look at, scene units. [3]
        radius: Mean distance of the cameras from it, scene units. What is farther away does not count.
        meters_per_unit: Where it is known.
    """
    has_moving = len(moving) >= FEWEST_MOVING
    low, high = _ends(moving if has_moving else still, up, focus, radius)
    is_measured = meters_per_unit is not None
    if meters_per_unit is None:
        is_person = has_moving and PERSON_M * radius <= FARTHEST_CAMERAS_M * (high - low)
        meters_per_unit = PERSON_M / (high - low) if is_person else CAMERAS_M / radius
    return {"floor": low, "meters_per_unit": float(meters_per_unit), "is_measured": is_measured}


def _ends(splats: Splats, up: np.ndarray, focus: np.ndarray, radius: float) -> tuple[float, float]:
    """Lowest and highest place of what can be seen near the focus, along the up direction, scene units."""
    is_near = np.linalg.norm(splats.means - focus, axis=1) < radius
    heights, weights = (splats.means @ up)[is_near], splats.opacities[is_near]
    if not weights.sum() > 0.0:
        level = float(np.dot(up, focus))
        return level - 0.5 * radius, level + 0.5 * radius
    order = np.argsort(heights)
    shares = np.cumsum(weights[order]) / weights.sum()
    places = np.searchsorted(shares, (ENDS_PERCENT / 100.0, 1.0 - ENDS_PERCENT / 100.0))
    return float(heights[order[places[0]]]), float(heights[order[places[1]]])
