"""Marks of each shape cover what their shape says, at the place and size asked for."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import pytest

from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from tests.ui.gl.scenes import centered_camera, make_camera
from ui.gl.points import INHERITED_ANCHOR_COLOR, RESIDUAL_ANCHOR_COLOR, PointRenderer, PointShape
from ui.gl.targets import Target

pytestmark = pytest.mark.gl

WHITE = np.ones(3)
ORIGIN = np.zeros((1, 3))


def alpha_of_origin(ctx: moderngl.Context, keep: Keep, distance: float = 4.0, **settings: Any) -> np.ndarray:
    camera = centered_camera(distance=distance)
    target, points = keep(Target(ctx, (64, 64), precision="f4")), keep(PointRenderer(ctx))
    points.set(ORIGIN, WHITE)
    points.draw(target, *camera.arguments, **settings)
    return read_color(target)[..., 3]


@pytest.mark.parametrize(
    ("shape", "area_share"),
    [
        ("circle", np.pi / 4),
        ("diamond", 1 / 2),
        ("ring", np.pi / 4 * (1 - (1 - 0.36) ** 2)),
    ],
)
def test_shape_covers_its_area(ctx: moderngl.Context, keep: Keep, shape: PointShape, area_share: float) -> None:
    """Shares of the square around the mark; a smooth edge conserves area to about one percent at 25 px."""
    alpha = alpha_of_origin(ctx, keep, shape=shape, size=25.0)
    assert alpha.sum() / 25.0**2 == pytest.approx(area_share, rel=0.02)
    np.testing.assert_allclose(alpha[1:, 1:], alpha[1:, 1:][::-1, ::-1], atol=1e-5)  # point symmetric about (32, 32)
    np.testing.assert_allclose(alpha[1:, 1:], alpha[1:, 1:].T, atol=1e-5)


def test_diamond_differs_from_circle_and_ring(ctx: moderngl.Context, keep: Keep) -> None:
    """Three places tell them apart: the middle, a tip's direction, and the diagonal."""
    middle, tip, diagonal = (32, 32), (32, 42), (40, 40)  # 0, 10 and 11.3 px from the middle; the radius is 12.5
    seen = {shape: alpha_of_origin(ctx, keep, shape=shape, size=25.0) for shape in ("circle", "ring", "diamond")}
    table = {shape: tuple(round(float(alpha[p])) for p in (middle, tip, diagonal)) for shape, alpha in seen.items()}
    assert table == {"circle": (1, 1, 1), "ring": (0, 1, 1), "diamond": (1, 1, 0)}


@pytest.mark.parametrize("shape", ["circle", "ring", "diamond"])
def test_shapes_still_differ_at_overlay_size(ctx: moderngl.Context, keep: Keep, shape: PointShape) -> None:
    alpha = alpha_of_origin(ctx, keep, shape=shape, size=7.0)[28:37, 28:37]
    others = [s for s in ("circle", "ring", "diamond") if s != shape]
    for other in others:
        difference = np.abs(alpha - alpha_of_origin(ctx, keep, shape=other, size=7.0)[28:37, 28:37])
        assert difference.sum() > 5.0, f"{shape} and {other} must differ by several pixels"


def test_points_stand_where_the_camera_projects_them(
    ctx: moderngl.Context, keep: Keep, rng: np.random.Generator
) -> None:
    camera = make_camera(yaw_rad=0.7, pitch_rad=-0.4)
    for position in rng.uniform(-0.6, 0.6, (6, 3)):
        target, points = keep(Target(ctx, (96, 72), precision="f4")), keep(PointRenderer(ctx))
        points.set(position[None], WHITE)
        points.draw(target, *camera.arguments, size=9.0)
        alpha = read_color(target)[..., 3].astype(np.float64)
        y, x = np.mgrid[0:72, 0:96] + 0.5
        center = np.array([(alpha * x).sum(), (alpha * y).sum()]) / alpha.sum()
        # Drivers place a sprite to a sixteenth of a pixel or better.
        np.testing.assert_allclose(center, camera.project(position[None])[0], atol=0.1)


def test_world_size_shrinks_with_distance_and_pixel_size_does_not(ctx: moderngl.Context, keep: Keep) -> None:
    near, far = (alpha_of_origin(ctx, keep, z, size=1.0, unit="world").sum() for z in (3.0, 6.0))
    assert near / far == pytest.approx(4.0, rel=0.03)
    assert near == pytest.approx(np.pi / 4 * (64 / 3.0) ** 2, rel=0.02)
    near, far = (alpha_of_origin(ctx, keep, z, size=9.0).sum() for z in (3.0, 6.0))
    assert near == pytest.approx(far, rel=1e-4)


def test_far_points_keep_a_pixel(ctx: moderngl.Context, keep: Keep) -> None:
    alpha = alpha_of_origin(ctx, keep, 5000.0, size=0.01, unit="world")
    assert 0.5 < alpha.sum() < 1.5


def test_depth_test_hides_farther_points_in_any_order(ctx: moderngl.Context, keep: Keep) -> None:
    positions = np.array([[0, 0, -1.0], [0, 0, 1.0]])
    colors = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    camera = centered_camera()
    for order in ([0, 1], [1, 0]):
        target, points = keep(Target(ctx, (64, 64), precision="f4")), keep(PointRenderer(ctx))
        points.set(positions[order], colors[order])
        points.draw(target, *camera.arguments, size=9.0, is_depth_tested=True)
        picture = read_color(target)
        np.testing.assert_allclose(picture[32, 32], [1, 0, 0, 1], atol=1e-6)
        assert set(np.unique(picture[..., 3])) == {0.0, 1.0}, "edges are sharp"


def test_outline_darkens_the_rim_only(ctx: moderngl.Context, keep: Keep) -> None:
    target, points = keep(Target(ctx, (64, 64), precision="f4")), keep(PointRenderer(ctx))
    points.set(ORIGIN, np.array(RESIDUAL_ANCHOR_COLOR))
    points.draw(target, *centered_camera().arguments, size=20.0, outline_px=2.0)
    row = read_color(target)[32]
    np.testing.assert_allclose(row[32, :3], RESIDUAL_ANCHOR_COLOR[:3], atol=1e-6)
    assert row[23, :3].max() < 0.1
    assert row[23, 3] == pytest.approx(1.0)


def test_colours_are_per_point_or_for_all(ctx: moderngl.Context, keep: Keep) -> None:
    target, points = keep(Target(ctx, (64, 64), precision="f4")), keep(PointRenderer(ctx))
    positions = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    places = [(32, 16), (32, 48)]
    points.set(positions, np.array([[1, 0, 0, 1.0], [0, 1, 0, 0.5]]))
    points.draw(target, *centered_camera().arguments, size=9.0, opacity=0.5)
    picture = read_color(target)
    np.testing.assert_allclose([picture[p] for p in places], [[0.5, 0, 0, 0.5], [0, 0.25, 0, 0.25]], atol=1e-6)
    target.clear()
    points.set(positions, np.array(INHERITED_ANCHOR_COLOR))
    points.draw(target, *centered_camera().arguments, size=9.0)
    picture = read_color(target)
    for place in places:
        assert np.round(255 * picture[place]).tolist() == [86, 180, 233, 255]


def test_points_before_the_near_plane_or_not_finite_are_not_drawn(ctx: moderngl.Context, keep: Keep) -> None:
    target, points = keep(Target(ctx, (64, 64))), keep(PointRenderer(ctx))
    camera = centered_camera(distance=0.0)
    points.set(np.array([[0, 0, -1.0], [0, 0, 0.4], [np.nan, 0, 1], [np.inf, 0, 1]]), WHITE)
    assert len(points) == 2
    points.draw(target, *camera.arguments, 0.5, size=9.0)
    assert not read_color(target).any()


def test_set_replaces_and_checks(ctx: moderngl.Context, keep: Keep) -> None:
    target, points, camera = keep(Target(ctx, (64, 64))), keep(PointRenderer(ctx)), centered_camera()
    points.draw(target, *camera.arguments)  # nothing set yet
    assert points.set(np.zeros((7, 3)), WHITE, key="a")
    assert not points.set(np.zeros((8, 3)), WHITE, key="a")
    assert len(points) == 7
    assert points.set(np.zeros((0, 3)), WHITE)
    points.draw(target, *camera.arguments)
    assert not read_color(target).any()
    with pytest.raises(ValueError, match=r"\[N, 3\]"):
        points.set(np.zeros((4, 2)), WHITE)
    with pytest.raises(ValueError, match="broadcast"):
        points.set(np.zeros((4, 3)), np.zeros((3, 3)))
