"""The lenses that are sought are those that captures have, and can be inverted."""

from __future__ import annotations

import numpy as np
import pytest

from engine.calibration.finishing import LENS_MODEL
from engine.calibration.solving.cameras import distort, undistort
from engine.camera.lens import Lens
from tests.engine.calibration.made_rigs import LENS_PARAMS


@pytest.mark.parametrize("lens", ["simple", "opencv", "fisheye"])
def test_lenses_are_those_of_captures(lens: str) -> None:
    plane = np.random.default_rng(0).uniform(-0.7, 0.7, (200, 2))
    params = np.tile(LENS_PARAMS[lens], (200, 1))
    known = Lens(LENS_MODEL[lens], tuple(LENS_PARAMS[lens]))  # type: ignore[arg-type]
    np.testing.assert_allclose(distort(lens, plane, params), known.distort(plane), atol=1e-12)


@pytest.mark.parametrize("lens", ["pinhole", "simple", "opencv", "fisheye"])
def test_undistort_is_the_inverse(lens: str) -> None:
    plane = np.random.default_rng(1).uniform(-0.8, 0.8, (300, 2))
    params = np.tile(LENS_PARAMS[lens], (300, 1)).reshape(300, -1)
    np.testing.assert_allclose(undistort(lens, distort(lens, plane, params), params), plane, atol=1e-8)
