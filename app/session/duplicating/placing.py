"""Where a new copy of an object stands: next to it, so that both are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.session.editing.selection import Selection
from engine.editing.scene_object import SceneObject

EDGE_PERCENT = 2.0
"""So many of its Gaussians may lie outside of the width of an object on either side: some fly off."""
LEAST_WIDTH = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class ObjectPlace:
    """Where an object is shown.

    Attributes:
        middle: Of it, scene units. [3] float64
        axes: Unit vectors across and along a floor, as a view sees them. [2, 3] float64
        widths: Of the object along these, scene units. [2] float64
    """

    middle: np.ndarray
    axes: np.ndarray
    widths: np.ndarray


def place_of(
    gaussians: GaussianArrays | None, found: SceneObject, frame: float, view: np.ndarray, up: np.ndarray
) -> ObjectPlace | None:
    """Where an object stands in a frame; None where it is not shown.

    Args:
        gaussians: The shown frame.
        frame: Which one that is.
        view: Rotation from the world to the camera, OpenCV axes. [3, 3]
        up: Direction of the world that is up. [3]
    """
    if gaussians is None or gaussians.rows is None:
        return None
    means = gaussians.means[Selection.of_target(found.picked(frame)).mask(gaussians.rows)].astype(np.float64)
    means = means[np.isfinite(means).all(axis=1)]
    if not len(means):
        return None
    across = _level(view[0], up, otherwise=view[0])
    away = _level(view[2], up, otherwise=-view[1])
    axes = np.stack([across, away])
    low, high = np.percentile(means @ axes.T, [EDGE_PERCENT, 100.0 - EDGE_PERCENT], axis=0)
    return ObjectPlace(np.median(means, axis=0), axes, np.maximum(high - low, LEAST_WIDTH))


def _level(direction: np.ndarray, up: np.ndarray, *, otherwise: np.ndarray) -> np.ndarray:
    """A direction along the floor; from straight above, another one."""
    up = np.asarray(up, np.float64) / np.linalg.norm(up)
    for wanted in (direction, otherwise):
        level = np.asarray(wanted, np.float64) - (wanted @ up) * up
        if np.linalg.norm(level) > 1e-3:
            return level / np.linalg.norm(level)
    return np.asarray(direction, np.float64)
