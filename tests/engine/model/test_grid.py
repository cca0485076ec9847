"""Hash grid: the numba kernels against torch indexing, and the constants themselves."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.model.grid import corner_table, encode, encode_reference


def make_case(*, n_rows: int, cells: tuple[int, ...], n_entries: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    corners = corner_table(rng.uniform(-0.1, 1.1, (n_rows, 3)), cells, n_entries)
    table = torch.from_numpy(rng.normal(size=(len(cells), n_entries, 4)).astype(np.float32))
    rows = rng.permutation(n_rows)[: max(n_rows // 2, 1)]
    return corners, table, rows


@pytest.mark.parametrize("cells", [(4,), (4, 9, 33)])
def test_encode_matches_reference_forward_and_gradient(cells):
    corners, table, rows = make_case(n_rows=200, cells=cells, n_entries=1024)
    fast = table.clone().requires_grad_(True)
    slow = table.double().requires_grad_(True)
    weight = torch.randn(len(rows), 4 * len(cells), generator=torch.Generator().manual_seed(1))
    out_fast, out_slow = encode(fast, rows, corners), encode_reference(slow, rows, corners)
    (out_fast * weight).sum().backward()
    (out_slow * weight.double()).sum().backward()
    # float32 sums of 8 products of size about 1: rounding stays below 1e-6
    assert (out_fast - out_slow).abs().max() < 2e-6
    assert fast.grad is not None
    assert slow.grad is not None
    # up to 100 rows share an entry at the coarsest level: 100 roundings of 6e-8 at values of a few
    assert (fast.grad - slow.grad).abs().max() < 2e-5


def test_no_rows_give_an_empty_result_and_a_zero_gradient():
    corners, table, _ = make_case(n_rows=5, cells=(4, 9), n_entries=1024)
    fast = table.clone().requires_grad_(True)
    out = encode(fast, np.zeros(0, np.int64), corners)
    assert out.shape == (0, 8)
    out.sum().backward()
    assert fast.grad is not None
    assert not fast.grad.any()


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
    out = encode(torch.from_numpy(table), np.arange(50), corner_table(positions, (n_cells,), 256))
    assert np.abs(out[:, 0].numpy() - positions @ [1.0, 2.0, 3.0]).max() < 1e-5
