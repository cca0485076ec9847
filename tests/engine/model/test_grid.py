"""Hash grid: corners and weights, and interpolation of functions that it must reproduce. Kernels: test_decoding."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.model.grid import corner_table, encode


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True, width=32), min_size=3, max_size=3))
def test_corners_stay_inside_the_table_for_any_position(position):
    corners = corner_table(np.array([position], np.float64), (8, 100), 256)
    assert corners.indices.min() >= 0
    assert corners.indices.max() < 256
    assert np.allclose(corners.weights.sum(-1), 1.0, atol=1e-6)


def test_dense_levels_interpolate_a_linear_function_exactly():
    n_cells = 4
    knots = np.stack(np.meshgrid(*[np.arange(n_cells + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    table = np.zeros((1, 256, 1), np.float32)
    entry = knots[:, 0] + (n_cells + 1) * (knots[:, 1] + (n_cells + 1) * knots[:, 2])
    table[0, entry, 0] = knots @ np.array([1.0, 2.0, 3.0]) / n_cells
    positions = np.random.default_rng(0).uniform(0, 1, (50, 3))
    out = encode(torch.from_numpy(table), torch.arange(50), corner_table(positions, (n_cells,), 256))
    assert np.abs(out[:, 0].numpy() - positions @ [1.0, 2.0, 3.0]).max() < 1e-5
