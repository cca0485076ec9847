"""Lens models against pycolmap's, which runs in a process of its own; and the way back."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from engine.camera.lens import MAX_RADIUS, Lens

CASES = [
    ("SIMPLE_RADIAL", [900, 640, 360, -0.2], Lens("opencv", (-0.2,))),
    ("RADIAL", [900, 640, 360, -0.2, 0.05], Lens("opencv", (-0.2, 0.05))),
    ("OPENCV", [900, 910, 640, 360, -0.28, 0.07, 0.001, -0.002], Lens("opencv", (-0.28, 0.07, 0.001, -0.002))),
    (
        "FULL_OPENCV",
        [900, 910, 640, 360, -0.28, 0.07, 0.001, -0.002, 0.01, 0.02, 0.03, 0.01],
        Lens("opencv", (-0.28, 0.07, 0.001, -0.002, 0.01, 0.02, 0.03, 0.01)),
    ),
    (
        "OPENCV_FISHEYE",
        [500, 510, 640, 360, -0.02, 0.007, 0.001, -0.002],
        Lens("fisheye", (-0.02, 0.007, 0.001, -0.002)),
    ),
    ("FOV", [900, 910, 640, 360, 0.7], Lens("fov", (0.7,))),
    (
        "THIN_PRISM_FISHEYE",
        [500, 510, 640, 360, -0.02, 0.007, 0.001, -0.002, 0.003, 0.001, 0.002, 0.003],
        Lens("thin_prism_fisheye", (-0.02, 0.007, 0.001, -0.002, 0.003, 0.001, 0.002, 0.003)),
    ),
]
_CHILD = """
import json, sys, zlib
import numpy as np, pycolmap
cases, points = json.load(sys.stdin)
found = []
for model, params in cases:
    camera = pycolmap.Camera(model=model, width=1280, height=720, params=params)
    K = camera.calibration_matrix()
    pixels = [camera.img_from_cam(np.array([x, y, 1.0])) for x, y in points]
    found.append([[(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]] for u, v in pixels])
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return np.random.default_rng(3).uniform(-0.8, 0.8, (200, 2))


@pytest.mark.slow
def test_models_agree_with_colmap(points: np.ndarray) -> None:
    asked = json.dumps([[[model, params] for model, params, _ in CASES], points.tolist()])
    told = subprocess.run([sys.executable, "-c", _CHILD], input=asked, capture_output=True, text=True, check=True)
    for (model, _, lens), expected in zip(CASES, json.loads(told.stdout), strict=True):
        assert np.abs(lens.distort(points) - np.array(expected)).max() < 1e-12, model


@pytest.mark.parametrize("lens", [case[2] for case in CASES], ids=[case[0] for case in CASES])
def test_undistorting_is_the_way_back(lens: Lens, points: np.ndarray) -> None:
    assert np.abs(lens.undistort(lens.distort(points)) - points).max() < 1e-9


def test_where_a_polynomial_folds_back_nothing_is_found() -> None:
    lens = Lens("opencv", (-0.5,))  # r (1 - r^2 / 2) rises up to r^2 = 2/3, where it is 0.544
    assert lens.max_radius() == pytest.approx(np.sqrt(2 / 3), rel=2e-3)
    assert np.isnan(lens.undistort(np.array([[0.6, 0.0]]))).all()
    assert np.isfinite(lens.undistort(np.array([[0.5, 0.0]]))).all()


def test_a_pinhole_changes_nothing() -> None:
    assert Lens("opencv", (0.0, 0.0)).is_pinhole
    assert Lens().max_radius() == MAX_RADIUS
    assert np.array_equal(Lens().distort(np.array([[1.0, 2.0]])), [[1.0, 2.0]])


@pytest.mark.parametrize(("model", "params"), [("mirror", ()), ("pinhole", (0.1,)), ("fisheye", (0.0,) * 5)])
def test_unknown_models_and_parameters_are_refused(model: str, params: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"parameters|unknown"):
        Lens(model, params)  # type: ignore[arg-type]
