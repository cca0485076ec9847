"""Rotations by three components, the curve through space, and codebooks."""

from __future__ import annotations

import numpy as np
import pytest

from engine.export.formats.codebook import SIZE, codebook
from engine.export.packing import as_levels, morton_order, quats_of_smaller_three, smaller_three
from tests.engine.export.scenes import angles_deg, chance_splats


def test_three_components_give_the_rotation_back():
    quats = chance_splats(2000).quats
    largest, three = smaller_three(quats)
    assert np.abs(three).max() <= np.sqrt(0.5) + 1e-6
    assert set(largest) == {0, 1, 2, 3}
    assert angles_deg(quats_of_smaller_three(largest, three), quats).max() < 0.05


@pytest.mark.parametrize("quat", [(1, 0, 0, 0), (0, 0, 0, -1), (0.5, -0.5, 0.5, -0.5), (0, 0.6, 0.8, 0)])
def test_rotations_with_zeros_and_ties(quat):
    quats = np.array([quat], np.float32)
    assert angles_deg(quats_of_smaller_three(*smaller_three(quats)), quats).max() < 0.05


def test_neighbours_along_the_curve_are_near_each_other():
    means = chance_splats(4096).means
    order = morton_order(means)
    assert sorted(order) == list(range(4096))
    along = np.linalg.norm(np.diff(means[order], axis=0), axis=1).mean()
    by_chance = np.linalg.norm(np.diff(means, axis=0), axis=1).mean()
    assert along < by_chance / 8


@pytest.mark.parametrize("means", [np.zeros((0, 3)), np.ones((1, 3)), np.full((300, 3), 7.0), np.eye(3) * 1e30])
def test_the_curve_takes_any_places(means):
    assert sorted(morton_order(means.astype(np.float32))) == list(range(len(means)))


def test_levels_are_the_nearest():
    np.testing.assert_array_equal(
        as_levels(np.array([-1.0, 0.0, 0.4 / 255, 0.6 / 255, 1.0, 2.0])), [0, 0, 0, 1, 255, 255]
    )
    assert as_levels(np.array([0.5]), 16)[0] == 32768


def test_a_codebook_keeps_the_largest_and_is_finer_than_even_steps():
    random = np.random.default_rng(3)
    values = np.concatenate([random.normal(-4.0, 0.5, 30_000), [-9.5, 2.5]])
    codes, indices = codebook(values)
    assert codes.shape == (SIZE,)
    assert (np.diff(codes) >= 0).all()
    assert (codes[0], codes[-1]) == pytest.approx((-9.5, 2.5))
    error = np.abs(codes[indices] - values)
    assert error.max() < 12.0 / 64
    even = 12.0 / 255
    assert np.sqrt((error**2).mean()) < 0.5 * even / np.sqrt(12)
    assert np.abs(codes - values[0]).min() == pytest.approx(error[0])


@pytest.mark.parametrize("values", [[], [3.0], [1.0, 1.0, 1.0], [0.0, -1.0, 5.0, 5.0], np.arange(256) / 7])
def test_few_numbers_are_kept_exactly(values):
    codes, indices = codebook(np.array(values))
    np.testing.assert_array_equal(codes[indices], np.array(values, float))
