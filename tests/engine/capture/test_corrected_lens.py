"""Corrections of what was seen, as Vicon writes lenses, against a solution of their own equation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.capture.cameras.corrected_lens import lens_of_correction
from engine.errors import CaptureError

SIZE = (1920, 1080)
K = np.array([[1000.0, 0, 960], [0, 1000, 540], [0, 0, 1]])
PATH = Path("a.xcp")


@pytest.mark.parametrize(
    ("centre", "coefficients", "most_px"),
    [
        ((960, 540), (6e-8, -1e-14, 0), 1e-3),  # 5 % in the corners
        ((960, 540), (1.5e-7, -5e-14, 1e-20), 1e-3),  # 12 %
        ((960, 540), (-5e-8, 1e-14, 0), 1e-3),
        ((950, 545), (6e-8, -1e-14, 0), 0.2),
        ((940, 560), (3e-8, -1e-14, 0), 0.3),
    ],
)
def test_points_are_seen_where_the_correction_has_them(
    centre: tuple[float, float], coefficients: tuple[float, ...], most_px: float
) -> None:
    lens = lens_of_correction(K, SIZE, np.array(centre), np.array(coefficients), path=PATH)
    seen = np.random.default_rng(1).uniform((0, 0), SIZE, (400, 2))
    r2 = ((seen - centre) ** 2).sum(-1, keepdims=True)
    straight = centre + (seen - centre) * (1 + sum(k * r2 ** (row + 1) for row, k in enumerate(coefficients)))
    rays = (straight - K[:2, 2]) / np.diag(K)[:2]
    assert np.abs(lens.distort(rays) * np.diag(K)[:2] + K[:2, 2] - seen).max() < most_px
    assert lens.max_radius() > np.linalg.norm(rays, axis=-1).max()


def test_no_correction_is_a_pinhole() -> None:
    assert lens_of_correction(K, SIZE, np.array([3.0, 4.0]), np.zeros(3), path=PATH).is_pinhole


@pytest.mark.parametrize("coefficients", [(2e-6, -3e-12, 1e-18), (float("nan"), 0, 0), (1e300, 1e300, 1e300)])
def test_a_lens_that_cannot_be_said_is_refused(coefficients: tuple[float, ...]) -> None:
    with pytest.raises(CaptureError, match="does not fit OpenCV's model: the error is"):
        lens_of_correction(K, SIZE, np.array([400.0, 545]), np.array(coefficients), path=PATH)
