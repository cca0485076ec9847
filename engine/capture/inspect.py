"""What a capture is, as plain data for `clipgstream inspect`. Looks at numbers, not at pixels."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from engine.capture.capture import Capture
from engine.capture.rig import CameraRig

SCHEMA = 1
"""Version of the keys below. Keys may be added under the same number, never renamed or taken away."""
NEAR_TWIN_SHARE = 1e-3
"""Two cameras closer than this share of the rig extent look like one camera listed twice."""


def describe(capture: Capture) -> dict[str, Any]:
    """Describe a capture with JSON-able values and stable keys.

    Returns:
        schema, path, format, fingerprint, n_cameras, n_frames, fps, duration_s, scale, default_holdout, cameras,
        rig_extent (largest distance between two cameras, scene units), focus_point [3], warnings (sentences).
        Each camera: name, path, width, height (stored), working_width, working_height, fx, fy, cx, cy (pixels at the
        working size), fov_x_deg, fov_y_deg, center [3], forward [3], focus_distance (scene units), is_default_holdout.
    """
    rig = capture.rig
    return {
        "schema": SCHEMA,
        "path": str(capture.path),
        "format": capture.format,
        "fingerprint": capture.fingerprint,
        "n_cameras": len(rig),
        "n_frames": capture.n_frames,
        "fps": capture.fps,
        "duration_s": capture.n_frames / capture.fps,
        "scale": capture.scale,
        "default_holdout": list(capture.default_holdout),
        "cameras": [_describe_camera(capture, row) for row in range(len(rig))],
        "rig_extent": rig_extent(rig),
        "focus_point": _floats(rig.focus_point()),
        "warnings": [*capture.warnings, *_rig_warnings(rig)],
    }


def rig_extent(rig: CameraRig) -> float:
    """Largest distance between two camera centres, scene units; 0 for a single camera."""
    differences = rig.centers[:, None] - rig.centers[None]
    return float(np.linalg.norm(differences, axis=-1).max())


def _describe_camera(capture: Capture, row: int) -> dict[str, Any]:
    rig = capture.rig
    K, center, forward = rig.Ks[row], rig.centers[row], rig.forwards[row]
    width, height = (int(value) for value in rig.image_sizes[row])
    return {
        "name": rig.names[row],
        "path": str(capture.store.sources[row].path),
        "width": int(capture.native_rig.image_sizes[row, 0]),
        "height": int(capture.native_rig.image_sizes[row, 1]),
        "working_width": width,
        "working_height": height,
        "fx": float(K[0, 0]),
        "fy": float(K[1, 1]),
        "cx": float(K[0, 2]),
        "cy": float(K[1, 2]),
        "fov_x_deg": _field_of_view_deg(K[0, 0], K[0, 2], width),
        "fov_y_deg": _field_of_view_deg(K[1, 1], K[1, 2], height),
        "center": _floats(center),
        "forward": _floats(forward),
        "focus_distance": float((rig.focus_point() - center) @ forward),
        "is_default_holdout": rig.names[row] in capture.default_holdout,
    }


def _field_of_view_deg(focal_px: float, centre_px: float, length_px: int) -> float:
    return float(np.degrees(np.arctan(centre_px / focal_px) + np.arctan((length_px - centre_px) / focal_px)))


def _floats(vector: np.ndarray) -> list[float]:
    return [float(value) for value in vector]


def _rig_warnings(rig: CameraRig) -> list[str]:
    """Odd but usable: one camera, two cameras in one place, different sizes, cameras that look away."""
    warnings = []
    if len(rig) == 1:
        warnings.append("There is only one camera; training needs at least two.")
    extent = rig_extent(rig)
    twins = [
        f"{rig.names[a]} and {rig.names[b]}"
        for a, b in combinations(range(len(rig)), 2)
        if np.linalg.norm(rig.centers[a] - rig.centers[b]) <= NEAR_TWIN_SHARE * extent
    ]
    if twins:
        warnings.append(f"Cameras in the same place: {', '.join(twins)}.")
    sizes = sorted({(int(width), int(height)) for width, height in rig.image_sizes})
    if len(sizes) > 1:
        warnings.append(f"Image sizes differ: {', '.join(f'{width}x{height}' for width, height in sizes)}.")
    depths = ((rig.focus_point() - rig.centers) * rig.forwards).sum(-1)
    away = [name for name, depth in zip(rig.names, depths, strict=True) if depth <= 0]
    if away:
        warnings.append(f"Cameras that look away from what the others look at: {', '.join(away)}.")
    return warnings
