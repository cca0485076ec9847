"""Which way is up, and the axes that a view is turned to: the world's, tilted so that one of them is exactly upright.
numpy only; OpenCV axes in cameras, scene units.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from engine.camera.rig import CameraRig

RIG_UP = "rig"
UP_AXES: dict[str, tuple[float, float, float] | None] = {
    RIG_UP: None,
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Choices of the upward direction: an axis of the world, or the one that the cameras agree on."""
AXIS_VIEWS = ("front", "back", "right", "left", "top", "bottom")
"""Views along an axis, named by where one stands."""


def rig_radius(rig: CameraRig) -> float:
    """Mean distance of the cameras from their focus, scene units."""
    return float(np.linalg.norm(rig.centers - rig.focus_point(), axis=1).mean())


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product of two vectors. numpy's own takes ten times as long for them. [3] float64"""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def horizontal_axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that form a right-handed frame with `up`: e0 x e1 = up. [3], [3]"""
    seed = np.eye(3)[int(np.argmin(np.abs(up)))]
    e0 = cross(seed, up)
    e0 /= np.linalg.norm(e0)
    return e0, cross(up, e0)


def scene_axes(up: np.ndarray) -> np.ndarray:
    """The axes x, y and z of a scene as rows: the world's, turned as little as makes one of them stand upright.

    Args:
        up: Unit vector. [3]
    Returns:
        Right-handed and orthonormal. The identity where an axis of the world is up. [3, 3]
    """
    upright = int(np.argmax(np.abs(up)))
    right = 1 if upright == 0 else 0
    axes = np.zeros((3, 3))
    axes[upright] = np.sign(up[upright]) * up
    axes[right] = np.eye(3)[right] - up[right] * up
    axes[right] /= np.linalg.norm(axes[right])
    other = 3 - upright - right
    axes[other] = cross(axes[(other + 1) % 3], axes[(other + 2) % 3])
    return axes


def axis_rotation(up: np.ndarray, name: str) -> np.ndarray:
    """How a camera is turned that looks along an axis: its right, down and forward directions as rows. [3, 3]

    Args:
        up: Unit vector. [3]
        name: One of AXIS_VIEWS.
    Raises:
        ValueError: There is no such view.
    """
    if name not in AXIS_VIEWS:
        raise ValueError(f"views along an axis are {', '.join(AXIS_VIEWS)}, not {name!r}")
    axes = scene_axes(up)
    side = axes[1 if np.argmax(np.abs(up)) == 0 else 0]
    ahead = cross(up, side)
    forward = {"front": ahead, "back": -ahead, "right": -side, "left": side, "top": -up, "bottom": up}[name]
    right = side if name in ("top", "bottom") else cross(forward, up)
    return np.stack([right, cross(forward, right), forward])


def view_from(up: np.ndarray, axis: int, sign: int) -> str:
    """The one of AXIS_VIEWS that stands at the positive or negative end of an axis of `scene_axes`.

    Args:
        up: Unit vector. [3]
        axis: 0, 1 or 2.
        sign: 1 or -1.
    """
    return _view_from(tuple(up.tolist()), axis, sign)


@lru_cache(maxsize=64)  # asked for all six ends in every frame that is drawn
def _view_from(up: tuple[float, ...], axis: int, sign: int) -> str:
    direction = np.array(up)
    toward = -sign * scene_axes(direction)[axis]
    return max(AXIS_VIEWS, key=lambda name: float(axis_rotation(direction, name)[2] @ toward))
