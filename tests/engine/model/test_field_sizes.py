"""Sizes of a field grow with what it has to hold, within limits."""

from itertools import pairwise

import pytest

from engine.model.field_sizes import derive_cells, derive_log2_entries, derive_strides


def test_levels_end_where_a_cell_is_as_small_as_the_distance_of_anchors():
    cells = derive_cells(side=1.0, spacing=0.02, base=4, growth=2.0, max_levels=16)
    assert cells == (4, 8, 16, 32, 64)
    assert 1.0 / cells[-2] > 1.5 * 0.02 >= 1.0 / cells[-1]


def test_there_are_no_more_levels_than_allowed_and_each_is_finer_than_the_one_before():
    cells = derive_cells(side=1.0, spacing=1e-9, base=2, growth=1.01, max_levels=9)
    assert len(cells) == 9
    assert all(fine > coarse for coarse, fine in pairwise(cells))
    assert derive_cells(side=1.0, spacing=10.0, base=4, growth=2.0, max_levels=9) == (4,)


@pytest.mark.parametrize(
    ("n_alive", "n_shared_knots", "expected"),
    [(0, 1, 10), (512, 1, 10), (513, 1, 11), (10**9, 1, 15), (0, 10, 12), (819, 10, 12), (820, 10, 13), (10**9, 9, 17)],
)
def test_a_table_has_two_entries_for_each_anchor_or_half_a_one_where_knots_share_it(n_alive, n_shared_knots, expected):
    assert derive_log2_entries(n_alive, n_shared_knots=n_shared_knots) == expected


@pytest.mark.parametrize(
    ("n_levels", "n_knots", "expected"),
    [
        (1, 10, (1,)),
        (2, 10, (1, 1)),
        (3, 10, (1, 1, 10)),
        (4, 10, (1, 1, 5, 10)),
        (6, 10, (1, 1, 1, 2, 5, 10)),
        (7, 10, (1, 1, 1, 2, 2, 5, 10)),
        (7, 4, (1, 1, 1, 2, 2, 4, 4)),
        (7, 1, (1, 1, 1, 1, 1, 1, 1)),
        (7, 300, (1, 1, 1, 2, 2, 5, 10)),
    ],
)
def test_coarse_levels_change_with_every_frame_and_fine_ones_keep_their_entries(n_levels, n_knots, expected):
    assert derive_strides(n_levels, n_knots) == expected
