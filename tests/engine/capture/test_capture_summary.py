"""The description of a capture: JSON-able, stable keys, right numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.capture_summary import describe, rig_extent


def test_description_is_json_with_the_documented_keys(make_sample: Callable[..., Path]) -> None:
    folder = make_sample(edit=lambda document: document.update(default_holdout=["cam01"]))
    found = json.loads(json.dumps(describe(open_capture(folder, scale=0.5)), allow_nan=False))
    assert list(found) == [
        "schema",
        "path",
        "format",
        "fingerprint",
        "n_cameras",
        "n_frames",
        "fps",
        "duration_s",
        "scale",
        "default_holdout",
        "cameras",
        "rig_extent",
        "focus_point",
        "has_points",
        "warnings",
    ]
    assert (found["schema"], found["n_cameras"], found["n_frames"], found["duration_s"]) == (1, 3, 6, 0.2)
    assert [camera["is_default_holdout"] for camera in found["cameras"]] == [False, True, False]
    camera = found["cameras"][0]
    assert (camera["width"], camera["height"], camera["working_width"], camera["working_height"]) == (48, 32, 24, 16)
    assert camera["fov_x_deg"] == pytest.approx(2 * np.degrees(np.arctan(12 / camera["fx"])), abs=0.5)
    assert found["warnings"] == []


def test_rig_extent_is_the_largest_distance(make_sample: Callable[..., Path]) -> None:
    rig = open_capture(make_sample()).rig
    expected = max(float(np.linalg.norm(a - b)) for a in rig.centers for b in rig.centers)
    assert rig_extent(rig) == pytest.approx(expected, rel=1e-12)
    assert rig_extent(rig.subset([0])) == 0.0


def test_a_single_camera_is_described_with_a_warning(make_sample: Callable[..., Path]) -> None:
    found = describe(open_capture(make_sample(n_cameras=1)))
    assert "only one camera" in found["warnings"][0]
    assert np.isfinite(found["focus_point"]).all()
