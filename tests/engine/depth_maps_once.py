"""Depth maps that are found once for the same pictures, for tests of what comes after them."""

from __future__ import annotations

import pickle
from copy import deepcopy
from hashlib import blake2b
from typing import Any

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.cloud.stereo import static_cloud

estimate = static_cloud.estimate_depth_maps


def remember_depth_maps(patch: pytest.MonkeyPatch, known: dict[bytes, Any]) -> None:
    """Let static clouds take depth maps that are known, and say what was said when they were found.

    Nothing of a known one is written to a preparation's folder, so tests of what is kept there go without.
    """

    def estimate_once(backgrounds: np.ndarray, is_stable: np.ndarray, rig: CameraRig, **options: Any) -> Any:
        report = options.pop("report")
        key = blake2b(pickle.dumps((backgrounds, is_stable, rig, options["sparse_points"]))).digest()
        if key not in known:
            lines: list[str] = []
            known[key] = estimate(backgrounds, is_stable, rig, report=lines.append, **options), lines
        found, lines = known[key]
        for line in lines:
            report(line)
        return deepcopy(found)

    patch.setattr(static_cloud, "estimate_depth_maps", estimate_once)
