"""The summary of a capture, as plain data for `clipgstream inspect`. Looks at numbers, not at pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.capture.cameras.rig_checks import rig_extent
from engine.capture.capture import Capture

SCHEMA = 1
"""Version of the keys below. Keys may be added under the same number, never renamed or taken away."""


def describe(capture: Capture) -> dict[str, Any]:
    """Describe a capture with JSON-able values and stable keys.

    Returns:
        schema, path, format, fingerprint, n_cameras, n_frames, fps, duration_s, scale, default_holdout, cameras,
        rig_extent (largest distance between two cameras, scene units), focus_point [3], has_points (a point cloud came
        along), warnings (sentences).
        Each camera: name, path, lens (model of the stored frames), has_masks, width, height (stored), working_width,
        working_height, fx, fy, cx, cy (pixels at the working size), fov_x_deg, fov_y_deg, center [3], forward [3],
        focus_distance (scene units), is_default_holdout.
    """
    rig = capture.rig
    focus_point, centers, forwards = rig.focus_point(), rig.centers, rig.forwards
    focus_distances = ((focus_point - centers) * forwards).sum(-1)  # [C]
    holdout = set(capture.default_holdout)
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
        "cameras": [
            _describe_camera(capture, row)
            | {
                "center": _floats(centers[row]),
                "forward": _floats(forwards[row]),
                "focus_distance": float(focus_distances[row]),
                "is_default_holdout": rig.names[row] in holdout,
            }
            for row in range(len(rig))
        ],
        "rig_extent": rig_extent(rig),
        "focus_point": _floats(focus_point),
        "has_points": capture.layout.points is not None,
        "warnings": list(capture.warnings),
    }


def _describe_camera(capture: Capture, row: int) -> dict[str, Any]:
    rig = capture.rig
    K = rig.Ks[row]
    width, height = (int(value) for value in rig.image_sizes[row])
    return {
        "name": rig.names[row],
        "path": str(capture.store.sources[row].path),
        "lens": capture.layout.cameras[row].lens.model,
        "has_masks": capture.layout.cameras[row].masks is not None,
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
    }


def _field_of_view_deg(focal_px: float, centre_px: float, length_px: int) -> float:
    return float(np.degrees(np.arctan(centre_px / focal_px) + np.arctan((length_px - centre_px) / focal_px)))


def _floats(vector: np.ndarray) -> list[float]:
    return [float(value) for value in vector]
