"""Hash grid: corners and weights, and interpolation of functions that it must reproduce. Kernels: test_decoding."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.model.grid import corner_table, corner_table_reference, encode, time_keys


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=3, max_size=3))
def test_corners_stay_inside_the_table_for_any_position(position):
    corners = corner_table(np.array([position], np.float64), (8, 100), 256)
    assert corners.indices.min() >= 0
    assert corners.indices.max() < 256
    assert torch.allclose(corners.weights.sum(-1), torch.ones(()), atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=3, max_size=30),
    st.sampled_from([(1,), (3, 30), (16, 524_288)]),
    st.sampled_from([64, 1 << 17]),
)
def test_corners_are_bit_for_bit_those_of_plain_numpy(values, cells, n_entries):
    positions = np.array(values[: len(values) // 3 * 3], np.float64).reshape(-1, 3)
    ours, truth = corner_table(positions, cells, n_entries), corner_table_reference(positions, cells, n_entries)
    assert torch.equal(ours.indices, truth.indices)
    assert torch.equal(ours.weights, truth.weights)


def test_dense_levels_interpolate_a_linear_function_exactly():
    n_cells = 4
    knots = np.stack(np.meshgrid(*[np.arange(n_cells + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    table = np.zeros((1, 256, 1), np.float32)
    entry = knots[:, 0] + (n_cells + 1) * (knots[:, 1] + (n_cells + 1) * knots[:, 2])
    table[0, entry, 0] = knots @ np.array([1.0, 2.0, 3.0]) / n_cells
    positions = np.random.default_rng(0).uniform(0, 1, (50, 3))
    out = encode(torch.from_numpy(table), torch.arange(50), corner_table(positions, (n_cells,), 256))
    assert np.abs(out[:, 0].numpy() - positions @ [1.0, 2.0, 3.0]).max() < 1e-5


def test_knots_of_a_small_level_do_not_share_entries_and_others_are_spread_over_the_table():
    n_entries, n_knots, cells = 1 << 12, 10, (4, 40)
    keys = time_keys(cells, n_entries, n_knots)
    assert keys.shape == (n_knots, 2)
    assert keys.min() >= 0
    assert keys.max() < n_entries
    corners = corner_table(np.random.default_rng(0).uniform(0, 1, (500, 3)), cells, n_entries)
    small = [set((corners.indices[:, 0] ^ key).ravel().tolist()) for key in keys[:, 0]]
    assert len(set.union(*small)) == sum(len(entries) for entries in small)  # 10 x 125 knots of space fit into 4096
    assert len(set(keys[:, 1].tolist())) == n_knots


def test_a_shared_table_at_knot_zero_is_that_of_space():
    table = torch.randn(2, 256, 3)
    corners = corner_table(np.random.default_rng(1).uniform(0, 1, (20, 3)), (3, 30), 256)
    keys = time_keys((3, 30), 256, 5)
    at_zero, later = (encode(table, torch.arange(20), corners, keys[knot]) for knot in (0, 3))
    assert torch.equal(at_zero, encode(table, torch.arange(20), corners))
    assert not torch.equal(later, at_zero)


def test_frames_that_a_level_does_not_tell_apart_have_one_key_and_others_different_ones():
    keys = time_keys((2, 3, 30), 256, 10, (1, 2, 5)).numpy()
    assert len(set(keys[:, 0].tolist())) == 10
    assert [len(set(keys[frame : frame + 2, 1].tolist())) for frame in range(0, 10, 2)] == [1] * 5
    assert [len(set(keys[frame : frame + 5, 2].tolist())) for frame in (0, 5)] == [1, 1]
    assert keys[0, 2] != keys[5, 2]
    assert np.array_equal(time_keys((2, 3, 30), 256, 10, (1, 1, 1)).numpy(), time_keys((2, 3, 30), 256, 10).numpy())
