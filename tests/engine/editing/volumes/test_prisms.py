"""Prisms against slow truths, and the one that a lasso cuts out of a view."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.camera.projection import to_camera, to_pixels
from engine.camera.rotations import matrices_of
from engine.editing.edit import MAX_CORNERS, Prism
from engine.editing.selection.in_picture import EXTENT_SIGMAS
from engine.editing.selection.shapes import lasso_mask
from engine.editing.selection.volumes import in_volume
from engine.editing.volumes.prisms import in_prism, prism_of_lasso
from tests.engine.editing.selection.made_views import scattered
from tests.engine.editing.slow_truth import is_in_prism

QUAT = (0.5, -0.5, 0.1, 0.7)
STAR = tuple(
    (r * math.cos(angle), r * math.sin(angle))
    for angle, r in zip(np.arange(10) * math.pi / 5, [1.0, 0.4] * 5, strict=True)
)
EIGHT = ((-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0))


@pytest.mark.parametrize("outline", [STAR, EIGHT, EIGHT[::-1], tuple(STAR) + tuple(STAR)])
@pytest.mark.parametrize("apex", [None, 1.2, 6.0])
def test_what_the_outline_goes_around_is_inside(outline: tuple[tuple[float, float], ...], apex: float | None) -> None:
    prism = Prism((0.1, -0.2, 0.3), (0.9, 0.7, 0.8), outline, QUAT, apex)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))
    found = in_prism(prism, points)
    assert found.tolist() == [is_in_prism(prism, point) for point in points]
    assert 50 < found.sum() < 2000


def test_what_is_not_finite_or_behind_the_eye_is_outside() -> None:
    prism = Prism((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), STAR, apex=1.001)
    points = np.array([[0, 0, 0], [0, 0, 1.0], [np.nan, 0, 0], [np.inf, 0, 0], [0, 0, -1.0005], [0, 0, -5.0]])
    assert in_prism(prism, points).tolist() == [True, True, False, False, False, False]
    assert len(in_prism(prism, np.zeros((0, 3)))) == 0


@pytest.mark.parametrize("apex", [None, 2.0])
def test_by_extent_what_reaches_into_it_belongs_to_it(apex: float | None) -> None:
    means, quats, scales, _ = scattered(200, seed=2)
    prism = Prism((0.3, -0.2, 0.5), (0.6, 1.1, 0.9), STAR, QUAT, apex)
    by_center, by_extent = in_volume(prism, means), in_volume(prism, means, quats=quats, scales=scales)
    assert (by_extent | ~by_center).all()
    assert by_extent.sum() > by_center.sum()
    assert not by_extent.all()
    flat = in_volume(prism, means, quats=quats, scales=np.full_like(scales, 1e-9))
    assert flat.tolist() == by_center.tolist()
    reach = EXTENT_SIGMAS * np.linalg.norm(scales, axis=1)
    for i in np.flatnonzero(by_extent & ~by_center):  # some point that near lies inside
        ball = np.random.default_rng(i).normal(size=(4000, 3))
        ball *= reach[i] / np.linalg.norm(ball, axis=1, keepdims=True) * np.linspace(0, 1.3, 4000)[:, None]
        assert in_volume(prism, means[i] + ball).any()


def _view() -> tuple[np.ndarray, np.ndarray]:
    matrix = np.eye(4)
    matrix[:3, :3] = matrices_of(np.array(QUAT))
    matrix[:3, 3] = (0.3, -0.4, 5.0)
    return matrix, np.array([[300.0, 0.0, 160.0], [0.0, 310.0, 120.0], [0.0, 0.0, 1.0]])


def test_a_lasso_cuts_out_of_the_view_what_lies_under_it() -> None:
    world_to_camera, K = _view()
    lasso = np.array([[200.0, 40.0], [300.0, 60.0], [240.0, 100.0], [310.0, 200.0], [190.0, 180.0]])
    prism = prism_of_lasso(lasso, world_to_camera, K, (3.0, 7.0))
    assert prism is not None
    mask = lasso_mask(lasso, (320, 240))
    points = np.random.default_rng(1).uniform(-4, 4, (20_000, 3))
    seen = to_camera(points, world_to_camera)
    pixels = np.floor(to_pixels(seen, K))
    is_near = (seen[:, 2] > 0) & (pixels >= 0).all(1) & (pixels < (320, 240)).all(1)
    column, row = np.where(is_near[:, None], pixels, 0).astype(int).T
    is_under = is_near & mask[row, column]
    found = in_prism(prism, points)
    middle = np.linalg.solve(K, np.array([250.0, 120.0, 1.0]))
    along = seen @ middle / np.linalg.norm(middle)
    is_between = (along > 3.0) & (along < 7.0)
    assert found.sum() > 100
    assert not (found & ~is_between).any()
    assert (found != (is_under & is_between)).sum() < 0.02 * found.sum(), "but for pixels on the line"


def test_a_long_lasso_keeps_its_shape_with_fewer_corners() -> None:
    world_to_camera, K = _view()
    angles = np.linspace(0, 2 * math.pi, 5000, endpoint=False)
    radii = 60 + 30 * np.sin(9 * angles)
    lasso = np.stack([160 + radii * np.cos(angles), 120 + radii * np.sin(angles)], axis=1)
    prism = prism_of_lasso(lasso, world_to_camera, K, (4.0, 6.0))
    assert prism is not None
    assert 60 < len(prism.outline) <= MAX_CORNERS
    corners = np.array(prism.outline) * prism.half_sizes[:2]
    x, y = corners.T
    area = abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2 / 25.0 * 300 * 310
    full = abs((lasso[:, 0] * np.roll(lasso[:, 1], -1) - lasso[:, 1] * np.roll(lasso[:, 0], -1)).sum()) / 2
    assert area == pytest.approx(full, rel=0.02)


@pytest.mark.parametrize(
    "pixels", [[[10.0, 10.0]], [[10.0, 10.0], [20.0, 10.0], [30.0, 10.0]], [[np.nan, 1.0], [2.0, 2.0], [3.0, 9.0]]]
)
def test_a_line_without_room_in_it_is_no_prism(pixels: list[list[float]]) -> None:
    assert prism_of_lasso(np.array(pixels), *_view(), (1.0, 2.0)) is None


def test_values_that_no_prism_may_have() -> None:
    for parts, expected in (
        ({"outline": STAR[:2]}, "has 2 corners, not 3 to 256"),
        ({"outline": ((0.0, 0.0),) * 257}, "has 257 corners"),
        ({"outline": ((0.0, 0.0), (1.1, 0.0), (0.0, 1.0))}, "not between -1 and 1"),
        ({"outline": ((0.0, 0.0), (math.nan, 0.0), (0.0, 1.0))}, "not between -1 and 1"),
        ({"half_sizes": (1.0, 0.0, 1.0)}, "is empty"),
        ({"half_sizes": (1.0, math.inf, 1.0)}, "not finite"),
        ({"apex": 1.0}, "sides of a prism meet 1 half depths away"),
        ({"apex": math.nan}, "sides of a prism meet"),
        ({"quat": (1.0, 1.0, 0.0, 0.0)}, "not a rotation"),
    ):
        with pytest.raises(ValueError, match=expected):
            Prism(**{"center": (0.0, 0.0, 0.0), "half_sizes": (1.0, 1.0, 1.0), "outline": STAR, **parts})
