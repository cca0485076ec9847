"""Undistorting pictures: against pictures drawn by formula, shrinking included, and what is valid afterwards."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.lens import Lens
from engine.capture.pixels.undistortion import Undistortion, undistorted_K

SIZE = (160, 120)
K = np.array([[150.0, 0.0, 83.0], [0.0, 148.0, 57.0], [0.0, 0.0, 1.0]])
LENSES = [Lens("opencv", (-0.25, 0.06, 0.002, -0.001)), Lens("opencv", (0.2,)), Lens("fisheye", (0.03, -0.01))]


def scene(xy: np.ndarray) -> np.ndarray:
    """Smooth colours over viewing directions [..., 2]: what any lens looks at. [..., 3] in 0..255"""
    x, y = xy[..., 0], xy[..., 1]
    return np.stack([128 + 100 * np.sin(6 * x), 128 + 100 * np.cos(5 * y), 128 + 100 * np.sin(4 * (x + y))], axis=-1)


def pixels(size: tuple[int, int]) -> np.ndarray:
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack([x, y], axis=-1)


def directions(size: tuple[int, int], matrix: np.ndarray) -> np.ndarray:
    return (pixels(size) - matrix[:2, 2]) / np.diag(matrix)[:2]


@pytest.mark.parametrize("shrink", [1.0, 0.5])
@pytest.mark.parametrize("lens", LENSES)
def test_straight_pictures_come_out_of_bent_ones(lens: Lens, shrink: float) -> None:
    bent = scene(np.nan_to_num(lens.undistort(directions(SIZE, K)))).round().astype(np.uint8)
    new_K = undistorted_K(K, lens, SIZE)
    new_K[:2] *= shrink
    new_size = (int(SIZE[0] * shrink), int(SIZE[1] * shrink))
    undistortion = Undistortion(lens, K, SIZE, new_K, new_size)
    picture, valid = undistortion.apply(bent), undistortion.valid()
    error = np.abs(picture - scene(directions(new_size, new_K)))[valid]
    assert valid.mean() > 0.7
    assert (picture[~valid] == 0).all()
    # rounding twice, and bilinear looking up of colours that turn by 6 rad over 150 px: 100 (6/150)^2 / 8 = 0.02
    assert error.max() < (1.5 if shrink == 1.0 else 2.0)


def test_what_the_lens_does_not_reach_is_not_valid() -> None:
    pincushion = Undistortion(LENSES[1], K, SIZE, K, SIZE).valid()
    assert not pincushion[0, 0]
    assert pincushion[60, 80]
    barrel = Undistortion(Lens("opencv", (-0.1,)), K, SIZE, K, SIZE).valid()
    assert barrel.all()


def test_a_fisheye_is_brought_to_the_view_asked_for() -> None:
    wide = np.array([[60.0, 0.0, 80.0], [0.0, 60.0, 60.0], [0.0, 0.0, 1.0]])  # 153 degrees across
    for asked, expected in ((90.0, 90.0), (None, 110.0), (179.0, 150.0)):
        made = undistorted_K(wide, Lens("fisheye", ()), SIZE, asked)
        assert 2 * np.degrees(np.arctan(80.0 / made[0, 0])) == pytest.approx(expected, abs=1e-6)
    narrow = undistorted_K(K, Lens("fisheye", ()), SIZE)  # sees less than 110 degrees: all of it is kept
    assert 2 * np.degrees(np.arctan(83.0 / narrow[0, 0])) == pytest.approx(2 * np.degrees(83.0 / 150.0), abs=1e-6)
