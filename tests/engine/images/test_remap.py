"""Resampling through a map, against the same in double precision; what is not wanted is black."""

from __future__ import annotations

import numpy as np
import pytest

from engine.images.remap import N_STEPS, WEIGHTS, remap

STEP_PX = 2


def bent(size: tuple[int, int], *, scale: float, shift: float) -> np.ndarray:
    """A lattice that bends a picture of this size a little, over some of its borders."""
    width, height = size
    x, y = np.meshgrid(
        np.arange(0, width + 2 * STEP_PX, STEP_PX, dtype=float),
        np.arange(0, height + 2 * STEP_PX, STEP_PX, dtype=float),
    )
    places = np.stack([scale * x + 1.5 * np.sin(y / 9.0) + shift, scale * y + 1.2 * np.cos(x / 7.0) - shift], axis=-1)
    return places.astype(np.float32)


def places_of(lattice: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The lattice at places of the new picture, bilinear, float64. [..., 2]"""
    u, v = x / STEP_PX, y / STEP_PX
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    right, down = (u - column)[..., None], (v - row)[..., None]
    values = lattice.astype(np.float64)
    above = values[row, column] * (1 - right) + values[row, column + 1] * right
    below = values[row + 1, column] * (1 - right) + values[row + 1, column + 1] * right
    return above * (1 - down) + below * down


def looked_up(image: np.ndarray, places: np.ndarray, *, is_cubic: bool) -> np.ndarray:
    """Values at places [..., 2], float64; beyond its border the picture goes on as it ends there."""
    height, width = image.shape[:2]
    at = np.clip(places - 0.5, 0.0, [width - 1.0, height - 1.0])
    first = np.floor(at).astype(int)
    share = at - first
    total = np.zeros((*places.shape[:-1], 3))
    for a in range(-1, 3) if is_cubic else range(2):
        for b in range(-1, 3) if is_cubic else range(2):
            rows = np.clip(first[..., 1] + a, 0, height - 1)
            columns = np.clip(first[..., 0] + b, 0, width - 1)
            weight = kernel(share[..., 1] - a, is_cubic=is_cubic) * kernel(share[..., 0] - b, is_cubic=is_cubic)
            total += weight[..., None] * image[rows, columns]
    return total


def kernel(distance: np.ndarray, *, is_cubic: bool) -> np.ndarray:
    d = np.abs(distance)
    if not is_cubic:
        return np.maximum(1.0 - d, 0.0)
    near, far = 1.5 * d**3 - 2.5 * d**2 + 1, -0.5 * d**3 + 2.5 * d**2 - 4 * d + 2
    return np.where(d < 1, near, np.where(d < 2, far, 0.0))


@pytest.mark.parametrize("n_sub", [1, 2, 3])
@pytest.mark.parametrize("shift", [0.0, 3.3, -4.7])
def test_it_is_that_of_double_precision(n_sub: int, shift: float) -> None:
    random = np.random.default_rng(3)
    image = random.integers(0, 256, (41, 53, 3)).astype(np.uint8)
    size = (53 // n_sub, 41 // n_sub)
    lattice = bent(size, scale=float(n_sub), shift=shift)
    everything = np.ones(size[::-1], bool)
    found = remap(image, lattice, STEP_PX, size, n_sub, everything)
    x, y = np.meshgrid((np.arange(size[0] * n_sub) + 0.5) / n_sub, (np.arange(size[1] * n_sub) + 0.5) / n_sub)
    values = looked_up(image.astype(np.float64), places_of(lattice, x, y), is_cubic=n_sub == 1)
    expected = values.reshape(size[1], n_sub, size[0], n_sub, 3).mean((1, 3))
    # half a level of rounding, and for cubics what a place rounded to 1/256 px makes of noise as steep as can be
    limit = 0.5 + 1e-3 if n_sub > 1 else 0.5 + 1.3 * 255 * 2 / (2 * N_STEPS)
    assert np.abs(found - np.clip(expected, 0, 255)).max() < limit
    assert np.abs(found - np.clip(expected, 0, 255)).mean() < 0.45


def test_weights_keep_flat_pictures_and_straight_ramps() -> None:
    shares = np.arange(N_STEPS + 1) / N_STEPS
    assert WEIGHTS.sum(1) == pytest.approx(1.0, abs=1e-6)
    assert WEIGHTS @ np.array([-1.0, 0.0, 1.0, 2.0]) == pytest.approx(shares, abs=1e-6)


@pytest.mark.parametrize("n_sub", [1, 2])
def test_what_is_not_wanted_is_black_and_changes_nothing_else(n_sub: int) -> None:
    image = np.random.default_rng(4).integers(30, 256, (40, 50, 3)).astype(np.uint8)
    size = (50 // n_sub, 40 // n_sub)
    lattice = bent(size, scale=float(n_sub), shift=0.0)
    is_valid = np.random.default_rng(5).random(size[::-1]) < 0.6
    whole = remap(image, lattice, STEP_PX, size, n_sub, np.ones_like(is_valid))
    found = remap(image, lattice, STEP_PX, size, n_sub, is_valid)
    assert np.array_equal(found, np.where(is_valid[..., None], whole, 0))


def test_pictures_of_a_few_pixels() -> None:
    for width, height in ((1, 1), (2, 1), (1, 3), (3, 3)):
        image = np.full((height, width, 3), 200, np.uint8)
        lattice = bent((width, height), scale=1.0, shift=0.0)
        assert (remap(image, lattice, STEP_PX, (width, height), 1, np.ones((height, width), bool)) == 200).all()
