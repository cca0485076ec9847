"""Oddities of a capture's cameras taken together: where they stand and where they look. Numbers only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from engine.camera.rig import CameraRig
from engine.errors import CaptureError

NEAR_TWIN_SHARE = 1e-3
"""Two cameras closer than this share of the rig extent look like one camera listed twice."""
FIT_DEG, MISS_DEG, LARGER, STEADIER = 25.0, 40.0, 2.0, 0.2
"""Poses look written the wrong way round when inverted ones make the better rig. The cameras then miss the point they
share by at most the first on average (5 degrees around a scene) and stand so many times as far apart; and as they were
written they miss it by more than the second, or agree that much less on which way is up."""
_ROWS = 256
"""Cameras whose distances to all others are taken at once."""
_LISTED = 3


def rig_extent(rig: CameraRig) -> float:
    """Largest distance between two camera centres, scene units; 0 for a single camera."""
    return max(float(distances.max()) for _, distances in _distances(rig.centers))


def check_rig(rig: CameraRig, extent: float, path: Path) -> list[CaptureError]:
    """All cameras at one point, as their extent says: depth cannot be seen from there, so nothing can be trained."""
    if len(rig) < 2 or extent > 1e-9 * max(1.0, float(np.abs(rig.centers).max())):
        return []
    hint = "Export their positions too."
    if rig_extent(_inverted(rig)) > 0:
        hint = "The poses may be camera-to-world maps: export their inverses, world to camera."
    place = ", ".join(f"{value:.3g}" for value in rig.centers[0] + 0.0)
    return [CaptureError(f"All {len(rig)} cameras stand at one point ({place}).", hint=hint, path=path)]


def rig_warnings(rig: CameraRig, extent: float) -> list[str]:
    """Odd but usable, as sentences: one camera, cameras in one place, different sizes, cameras that look away.

    extent: Of the rig, see `rig_extent`.
    """
    warnings = []
    if len(rig) == 1:
        warnings.append("There is only one camera; training needs at least two.")
    twins = _twins(rig, extent)
    if twins:
        warnings.append(
            f"Cameras in the same place: {_listed(twins)}. If one of them was listed twice, take it out; otherwise "
            "check their calibration."
        )
    sizes = sorted({(int(width), int(height)) for width, height in rig.image_sizes})
    if len(sizes) > 1:
        warnings.append(f"Image sizes differ: {_listed([f'{width}x{height}' for width, height in sizes])}.")
    if _looks_inverted(rig, extent):
        warnings.append(
            "The poses look like camera-to-world maps: inverted, the cameras stand around a scene and look at it, as "
            "written they do not. Export the inverses, world to camera."
        )
        return warnings
    away = [name for name, cosine in zip(rig.names, _cosines(rig), strict=True) if cosine <= 0]
    if away:
        warnings.append(f"Cameras that face away from the scene: {_listed(away)}. Check their calibration.")
    return warnings


def _twins(rig: CameraRig, extent: float) -> list[str]:
    nearest = NEAR_TWIN_SHARE * extent
    pairs = []
    for start, distances in _distances(rig.centers):
        rows, others = np.nonzero(distances <= nearest)
        pairs += [(start + a, b) for a, b in zip(rows.tolist(), others.tolist(), strict=True) if start + a < b]
    return [f"{rig.names[a]} and {rig.names[b]}" for a, b in pairs]


def _distances(centers: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Rows of the matrix of distances [C, C], some at a time with the index of the first."""
    offsets = centers - centers.mean(0)  # products of small numbers lose no digits of small differences
    squares = (offsets**2).sum(-1)
    for start in range(0, len(centers), _ROWS):
        rows = slice(start, start + _ROWS)
        products = offsets[rows] @ offsets.T
        yield start, np.sqrt(np.maximum(squares[rows, None] + squares - 2 * products, 0.0))


def _cosines(rig: CameraRig) -> np.ndarray:
    """Of the angle between where each camera looks and the point that all share. [C]"""
    towards = rig.focus_point() - rig.centers
    return (towards * rig.forwards).sum(-1) / np.maximum(np.linalg.norm(towards, axis=-1), 1e-12)


def _miss_deg(rig: CameraRig) -> float:
    return float(np.degrees(np.arccos(np.clip(_cosines(rig), -1.0, 1.0))).mean())


def _looks_inverted(rig: CameraRig, extent: float) -> bool:
    """Whether the cameras make a better rig when their poses are inverted."""
    if len(rig) < 3:
        return False
    inverted = _inverted(rig)
    is_steadier = _miss_deg(rig) > MISS_DEG or _agreement(inverted) > _agreement(rig) + STEADIER
    is_fitting = is_steadier and _miss_deg(inverted) < FIT_DEG
    return is_fitting and rig_extent(inverted) > LARGER * extent


def _agreement(rig: CameraRig) -> float:
    """How alike the cameras' down directions are: 1 when all are the same, near 0 when they point anywhere."""
    return float(np.linalg.norm(rig.world_to_camera[:, 1, :3].mean(0)))


def _inverted(rig: CameraRig) -> CameraRig:
    maps = np.broadcast_to(np.eye(4), (len(rig), 4, 4)).copy()
    maps[:, :3, :3] = rig.world_to_camera[:, :3, :3].transpose(0, 2, 1)
    maps[:, :3, 3] = rig.centers
    return CameraRig(rig.names, maps, rig.Ks, rig.image_sizes)


def _listed(items: Sequence[str]) -> str:
    shown = ", ".join(items[:_LISTED])
    return shown if len(items) <= _LISTED else f"{shown} and {len(items) - _LISTED} more"
