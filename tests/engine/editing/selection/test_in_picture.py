"""Which Gaussians lie under a mask, against a slow projection."""

from __future__ import annotations

import numpy as np
import pytest

from engine.conventions import EPS2D_PX2
from engine.editing.selection.in_picture import EXTENT_SIGMAS, under_mask
from engine.editing.selection.projected import project_gaussians
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.shapes import brush_mask, rectangle_mask
from tests.engine.editing.selection.made_views import SIZE, scattered, slow_spread, view_at

MASK = brush_mask(np.array([[10.0, 8.0], [30.0, 25.0]]), 5.0, SIZE)


def slow_found(view: SeenFrom, arrays: tuple[np.ndarray, ...], mask: np.ndarray, *, is_by_extent: bool) -> np.ndarray:
    means, quats, scales, _ = arrays
    found = np.zeros(len(means), bool)
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=1)
    for i in range(len(means)):
        if view.world_to_camera[2, :3] @ means[i] + view.world_to_camera[2, 3] <= view.near:
            continue
        center, spread = slow_spread(means[i], quats[i], scales[i], view)
        x, y = np.floor(center[:2]).astype(int)
        found[i] = 0 <= x < SIZE[0] and 0 <= y < SIZE[1] and mask[y, x]
        if is_by_extent:
            inverse = np.linalg.inv(spread[:2, :2] + EPS2D_PX2 * np.eye(2))
            off = pixels - center[:2]
            found[i] |= (np.einsum("pi,ij,pj->p", off, inverse, off) <= EXTENT_SIGMAS**2).any()
    return found


@pytest.mark.parametrize("is_by_extent", [False, True])
@pytest.mark.parametrize("set_back", [0.0, 5000.0], ids=["perspective", "orthographic"])
def test_what_lies_under_a_mask(is_by_extent: bool, set_back: float) -> None:
    arrays, view = scattered(400), view_at(set_back=set_back, near=0.01 + set_back)
    # The lens is linearised at the border for what lies beyond it, so those that lie there are another matter.
    projected = project_gaussians(*arrays[:3], view)
    is_near = (np.abs(projected.centers - np.array(SIZE) / 2) < np.array(SIZE) * 0.6).all(axis=1)
    found = under_mask(projected, MASK, is_by_extent=is_by_extent)
    truth = slow_found(view, arrays, MASK, is_by_extent=is_by_extent)
    assert 10 < truth.sum() < 390
    np.testing.assert_array_equal(found[is_near], truth[is_near])
    assert not (found & ~projected.is_before).any()
    assert not found[arrays[0][:, 2] <= -4.0].any()  # behind the camera


def test_an_extent_reaches_further_than_a_centre() -> None:
    arrays, view = scattered(300, seed=3), view_at()
    projected = project_gaussians(*arrays[:3], view)
    by_center, by_extent = (under_mask(projected, MASK, is_by_extent=is_on) for is_on in (False, True))
    assert (by_extent | ~by_center).all()
    assert by_extent.sum() > by_center.sum() + 10


def test_the_edge_of_the_picture_belongs_to_it_and_what_lies_beyond_does_not() -> None:
    view = view_at(distance=1.0, focal=1.0)
    places = [[-24.0, -18.0], [23.999, 17.999], [24.0, 0.0], [-24.001, 0.0], [0.0, 18.0]]
    means = np.array([[x, y, 0.0] for x, y in places], np.float32)
    quats, scales = np.tile(np.eye(4, dtype=np.float32)[0], (5, 1)), np.full((5, 3), 1e-6, np.float32)
    projected = project_gaussians(means, quats, scales, view)
    everything = rectangle_mask(-1e3, -1e3, 1e3, 1e3, SIZE)
    assert under_mask(projected, everything).tolist() == [True, True, False, False, False]


def test_what_is_not_finite_and_what_is_no_rotation_are_never_found() -> None:
    means, quats, scales, _ = (array.copy() for array in scattered(6))
    means[:] = 0.0
    means[0, 1], quats[1] = np.nan, 0.0
    scales[2, 0], quats[3, 2] = np.inf, np.nan
    scales[4] = 3e38
    projected = project_gaussians(means, quats, scales, view_at())
    everything = np.ones((SIZE[1], SIZE[0]), bool)
    for is_by_extent in (False, True):
        assert under_mask(projected, everything, is_by_extent=is_by_extent).tolist() == [False] * 4 + [True, True]
    assert np.isfinite(projected.centers).all()


def test_nothing_under_nothing() -> None:
    empty = np.zeros((0, 3), np.float32)
    projected = project_gaussians(empty, np.zeros((0, 4), np.float32), empty, view_at())
    assert len(under_mask(projected, MASK, is_by_extent=True)) == 0
    projected = project_gaussians(*scattered(5)[:3], view_at())
    assert not under_mask(projected, np.zeros_like(MASK), is_by_extent=True).any()


def test_bad_views_and_masks_are_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        SeenFrom(np.full((4, 4), np.nan), np.eye(3), 4, 4)
    with pytest.raises(ValueError, match="shows nothing"):
        SeenFrom(np.eye(4), np.eye(3), 0, 4)
    with pytest.raises(ValueError, match="needs a pose"):
        SeenFrom(np.eye(3), np.eye(3), 4, 4)
    with pytest.raises(ValueError, match="does not belong"):
        under_mask(project_gaussians(*scattered(3)[:3], view_at()), np.ones((3, 3), bool))
