"""Regions that a user marks: here everything counts as static, or as dynamic, whatever the pictures say.

Plain values that travel as JSON: {"treat": "static", "box": [[x, y, z], [x, y, z]]} with two opposite corners, or
{"treat": "dynamic", "sphere": [[x, y, z], radius]}; scene units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.errors import ProjectError

TREATMENTS = ("static", "dynamic")


@dataclass(frozen=True, slots=True)
class GateRegion:
    """A box or a sphere with what counts inside it. Borders belong to it.

    Attributes:
        treat: "static": nothing moves here. "dynamic": every anchor here has a dynamic feature.
        low, high: Corners of a box, or of the box around the sphere, scene units.
        radius: Of a sphere, scene units; 0 for a box.
    """

    treat: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    radius: float = 0.0

    @property
    def center(self) -> tuple[float, float, float]:
        """Middle of it, scene units."""
        x, y, z = (0.5 * (a + b) for a, b in zip(self.low, self.high, strict=True))
        return x, y, z

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which of these points lie inside. points: [P, 3]; gives [P] bool"""
        if self.radius > 0.0:
            return np.asarray(((points - np.array(self.center)) ** 2).sum(axis=1) <= self.radius**2)
        return np.asarray(((points >= np.array(self.low)) & (points <= np.array(self.high))).all(axis=1))

    def as_dict(self) -> dict[str, Any]:
        """As `parse_region` takes it."""
        if self.radius > 0.0:
            return {"treat": self.treat, "sphere": [list(self.center), self.radius]}
        return {"treat": self.treat, "box": [list(self.low), list(self.high)]}


def parse_region(values: Any) -> GateRegion:
    """A region from what JSON gives.

    Raises:
        ProjectError: It is not a region; says what is wrong.
    """
    hint = 'Write {"treat": "static" or "dynamic", "box": [corner, corner]}, or "sphere": [centre, radius].'
    shapes = set(values) - {"treat"} if isinstance(values, dict) else set()
    if not isinstance(values, dict) or values.get("treat") not in TREATMENTS or shapes not in ({"box"}, {"sphere"}):
        raise ProjectError(f"{values!r:.200} is not a region of the gate.", hint=hint)
    try:
        if "box" in values:
            corners = np.array(values["box"], dtype=np.float64).reshape(2, 3)
            low, high, radius = corners.min(axis=0), corners.max(axis=0), 0.0
        else:
            center, radius = np.array(values["sphere"][0], dtype=np.float64).reshape(3), float(values["sphere"][1])
            if not (len(values["sphere"]) == 2 and radius > 0.0):
                raise ValueError(f"radius {radius}")
            low, high = _box_around(center, radius)
    except (TypeError, ValueError, LookupError, OverflowError) as error:
        raise ProjectError(f"{values!r:.200} is not a region of the gate ({error}).", hint=hint) from error
    if not (np.isfinite(low).all() and np.isfinite(high).all() and math.isfinite(radius)):
        raise ProjectError(f"{values!r:.200} holds numbers that are not finite.", hint=hint)
    x0, y0, z0 = low.tolist()
    x1, y1, z1 = high.tolist()
    return GateRegion(values["treat"], (x0, y0, z0), (x1, y1, z1), radius)


def _box_around(center: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners whose middle gives the same corners again, so that what is written and read stays as it is."""
    for _ in range(8):  # two are enough; rounding moves the middle by a bit
        center = 0.5 * ((center - radius) + (center + radius))
    return center - radius, center + radius


def sphere_region(treat: str, center: Sequence[float], radius: float) -> GateRegion:
    """A sphere. center: scene units, [3]. Raises like `parse_region`."""
    return parse_region({"treat": treat, "sphere": [[float(value) for value in center], float(radius)]})


def marked(points: np.ndarray, regions: Sequence[GateRegion], treat: str) -> np.ndarray:
    """Points whose last region says this treatment; later regions overrule earlier ones. [P, 3] to [P] bool"""
    is_marked = np.zeros(len(points), dtype=bool)
    for region in regions:
        is_marked[region.contains(points)] = region.treat == treat
    return is_marked
