"""Camera paths that are made for a scene: round what is looked at, and along the cameras that took it. Pure numbers."""

from __future__ import annotations

import math

import numpy as np

from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.projection import vertical_fov
from engine.camera.rig import CameraRig

KEYS_PER_TURN = 16
"""Between so many keys on a circle the path is within 0.06 % of it."""
MAX_ELEVATION_RAD = math.radians(89.0)
DEFAULT_FOV_Y_RAD = math.radians(50.0)
_MAX_TURNS = 100.0
_MIN_STEP_SHARE = 0.01
"""From one camera to the next takes at least this share of the mean time, however close they stand."""


def turntable(
    center: np.ndarray,
    up: np.ndarray,
    radius: float,
    elevation: float,
    frames: tuple[float, float],
    n_turns: float = 1.0,
    *,
    fov_y_rad: float = DEFAULT_FOV_Y_RAD,
    start: np.ndarray | None = None,
    name: str = "Turntable",
) -> CameraPath:
    """Round a point at an even pace, looking at it. Whole turns make a loop without a seam.

    Args:
        center: The point looked at, scene units. [3]
        up: [3]
        radius: Distance from `center`, scene units.
        elevation: Angle above the horizon through `center`, radians; held within MAX_ELEVATION_RAD.
        frames: The frame at which it begins and the one at which it has gone round, which is not part of a loop.
        n_turns: Seen from above, positive ones go counterclockwise.
        fov_y_rad: Vertical field of view, radians.
        start: Direction from `center` in which it begins; only its level part counts. Any one when None. [3]
    Raises:
        ValueError: A value is not valid.
    """
    center, up = np.asarray(center, dtype=np.float64), np.asarray(up, dtype=np.float64)
    length = float(np.linalg.norm(up))
    if not (np.isfinite(center).all() and math.isfinite(length) and length > 1e-9):
        raise ValueError("a turntable needs a point to look at and an upright direction")
    if not (math.isfinite(radius) and radius > 0 and math.isfinite(elevation)):
        raise ValueError("a turntable needs a radius above zero and an elevation")
    if not (math.isfinite(n_turns) and 0 < abs(n_turns) <= _MAX_TURNS and frames[0] < frames[1]):
        raise ValueError(f"a turntable takes up to {_MAX_TURNS:g} turns in an ascending range of frames")
    up = up / length
    elevation = min(max(elevation, -MAX_ELEVATION_RAD), MAX_ELEVATION_RAD)
    e0 = _level(start, up)
    e1 = np.cross(up, e0)
    is_loop = float(n_turns).is_integer()
    n_pieces = max(math.ceil(KEYS_PER_TURN * abs(n_turns)), 2)
    shares = np.arange(n_pieces if is_loop else n_pieces + 1) / n_pieces
    keys = []
    for share in shares.tolist():
        angle = 2.0 * math.pi * n_turns * share
        outward = math.cos(elevation) * (math.cos(angle) * e0 + math.sin(angle) * e1) + math.sin(elevation) * up
        frame = frames[0] + share * (frames[1] - frames[0])
        keys.append(CameraKey(frame, _looking(center + radius * outward, -outward, up), fov_y_rad))
    return CameraPath(name, tuple(keys), is_closed=is_loop)


def fly_through(rig: CameraRig, frames: tuple[float, float], *, name: str = "Fly-through") -> CameraPath:
    """From camera to camera of a rig, each looked through for a moment, at an even pace.

    They are visited so that the way is short. A camera that hangs on its side or head is turned upright.

    Args:
        frames: First and last frame.
    Raises:
        ValueError: The rig has no cameras, or the frames are not in order.
    """
    if not len(rig) or not frames[0] < frames[1]:
        raise ValueError("a fly-through needs a camera and an ascending range of frames")
    order = visiting_order(rig.centers)
    steps = np.linalg.norm(np.diff(rig.centers[order], axis=0), axis=1)
    mean = float(steps.mean()) if len(steps) else 0.0
    steps = np.maximum(steps, _MIN_STEP_SHARE * mean) if mean > 0 else np.ones(len(steps))
    shares = np.concatenate([[0.0], np.cumsum(steps)]) / max(float(steps.sum()), 1e-12)
    up = rig.up_direction()
    keys = [
        CameraKey(frames[0] + share * (frames[1] - frames[0]), *_upright(rig, camera, up))
        for camera, share in zip(order, shares.tolist(), strict=True)
    ]
    return CameraPath(name, tuple(keys))


def visiting_order(centers: np.ndarray) -> list[int]:
    """Indices of points [C, 3] in the order of a short way through all of them, from one end to the other.

    Always the next nearest one from an outermost point, and then pieces of the way are turned round as long as that
    makes it shorter.
    """
    n = len(centers)
    distances = np.linalg.norm(centers[:, None] - centers[None], axis=-1)
    order = [int(np.argmax(np.linalg.norm(centers - centers.mean(0), axis=1)))]
    left = set(range(n)) - set(order)
    while left:
        order.append(min(left, key=lambda index: (distances[order[-1], index], index)))
        left.remove(order[-1])
    for _ in range(n):
        found = _shorter(order, distances)
        if found is None:
            break
        order = found
    return order


def _shorter(order: list[int], distances: np.ndarray) -> list[int] | None:
    """The way with the piece turned round that makes it shortest; None where none makes it shorter."""
    way = np.array(order)
    n = len(way)
    if n < 3:
        return None
    # turning round way[i..j] replaces the steps into i and out of j; at the ends of the way there is only one of them
    into = np.concatenate([[0.0], distances[way[:-1], way[1:]]])
    out_of = np.append(into[1:], 0.0)
    new_into = np.vstack([np.zeros(n), distances[way[:-1]][:, way]])  # [i, j]: from before i to j
    new_out = np.hstack([distances[way][:, way[1:]], np.zeros((n, 1))])  # [i, j]: from i to behind j
    change = np.triu(new_into + new_out - into[:, None] - out_of[None], k=1)
    i, j = np.unravel_index(int(np.argmin(change)), change.shape)
    if change[i, j] > -1e-9 * max(float(distances.max()), 1e-12):
        return None
    way[i : j + 1] = way[i : j + 1][::-1].copy()
    return way.tolist()


def _level(direction: np.ndarray | None, up: np.ndarray) -> np.ndarray:
    """The level part of a direction as a unit vector; that of an axis of the world where there is none. [3]"""
    for candidate in ([] if direction is None else [np.asarray(direction, dtype=np.float64)]) + [*np.eye(3)]:
        level = candidate - float(candidate @ up) * up
        length = float(np.linalg.norm(level))
        if math.isfinite(length) and length > 1e-2 * max(float(np.linalg.norm(candidate)), 1e-9):
            return level / length
    raise AssertionError("two axes of the world are never both upright")


def _looking(eye: np.ndarray, forward: np.ndarray, up: np.ndarray) -> np.ndarray:
    """World to camera of a level camera. forward: Unit vector, not upright. [4, 4]"""
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return _rigid(np.stack([right, np.cross(forward, right), forward]), eye)


def _rigid(rotation: np.ndarray, eye: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ eye
    return matrix


def _upright(rig: CameraRig, camera: int, up: np.ndarray) -> tuple[np.ndarray, float]:
    """World to camera and vertical field of view of a camera, turned by quarters so that its top is most upward."""
    right, down, forward = rig.world_to_camera[camera, :3, :3]
    turned = [(right, down), (down, -right), (-right, -down), (-down, right)]
    quarter = int(np.argmax([-float(low @ up) for _, low in turned]))
    rotation = np.stack([*turned[quarter], forward])
    axis = 1 if quarter % 2 == 0 else 0
    fov_y = vertical_fov(float(rig.Ks[camera, axis, axis]), float(rig.image_sizes[camera, axis]))
    return _rigid(rotation, rig.centers[camera]), fov_y
