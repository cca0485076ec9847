"""Pictures that explain: overdraw against the definition, ellipsoids against spheres written out, and hard cases."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.inspection.ellipsoids import AMBIENT, ISO, ellipsoids
from engine.backends.inspection.overdraw import overdraw
from engine.backends.reference.raster import drawable_rows, project
from engine.conventions import ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView

BACKGROUND = (0.1, 0.2, 0.3)


def view(width: int = 40, height: int = 30, near: float = 0.05) -> PinholeView:
    """Looks along z from the origin; the principal point is off centre and the focal lengths differ."""
    return PinholeView(np.eye(3), np.zeros(3), 34.0, 30.0, 21.0, 13.0, width, height, near)


def cloud(n: int, *, seed: int = 0) -> Gaussians:
    """Overlapping Gaussians before the camera."""
    made = torch.Generator().manual_seed(seed)

    def random(*size: int) -> torch.Tensor:
        return torch.rand(size, generator=made)

    means = (random(n, 3) - 0.5) * torch.tensor([2.0, 1.6, 1.0]) + torch.tensor([0.0, 0.0, 2.0])
    return Gaussians(means, random(n, 4) - 0.5, 0.02 + 0.2 * random(n, 3), random(n), random(n, 3))


def ball(center: tuple[float, float, float], radius: float, *, opacity: float = 0.9) -> Gaussians:
    """One round Gaussian whose body has this radius."""
    return Gaussians(
        torch.tensor([center]),
        torch.tensor([[1.0, 0.0, 0.0, 0.0]]),
        torch.full((1, 3), radius / ISO),
        torch.tensor([opacity]),
        torch.tensor([[0.8, 0.4, 0.2]]),
    )


def spoiled() -> Gaussians:
    """Good rows among rows that cannot be drawn: NaN and infinity everywhere they can be, and no rotation."""
    good = cloud(12)
    columns = [tensor.clone() for tensor in good.tensors()]
    columns[0][0, 1], columns[0][1, 2] = torch.nan, torch.inf
    columns[1][2], columns[1][3, 0] = 0.0, torch.nan
    columns[2][4, 1], columns[2][5, 0] = torch.nan, torch.inf
    columns[3][6], columns[3][7] = torch.nan, 0.0
    columns[4][8, 0] = torch.nan
    columns[0][9, 2] = -2.0
    return Gaussians(*columns)


def counted_by_definition(gaussians: Gaussians, camera: PinholeView) -> np.ndarray:
    """Every pixel by itself, front to back."""
    rows = drawable_rows(gaussians, camera)
    drawn = gaussians[rows]
    centers, covariances, _ = project(drawn, camera)
    counts = np.zeros((camera.height, camera.width), int)
    for y in range(camera.height):
        for x in range(camera.width):
            left = 1.0
            offsets = torch.tensor([x + 0.5, y + 0.5]) - centers
            powers = 0.5 * torch.einsum("ni,nij,nj->n", offsets, torch.linalg.inv(covariances), offsets)
            for alpha in (drawn.opacities * torch.exp(-powers)).tolist():
                if left < TRANSMITTANCE_MIN:
                    break
                if alpha >= ALPHA_MIN:
                    counts[y, x] += 1
                    left *= 1.0 - min(alpha, ALPHA_MAX)
    return counts


def test_overdraw_counts_what_blends_in_a_pixel() -> None:
    gaussians, camera = cloud(60), view()
    expected = counted_by_definition(gaussians, camera)
    found = overdraw(gaussians, camera)
    assert expected.max() > 10
    assert (found != expected).sum() <= 2, "rounding of float32 may move a border across a pixel's centre"


def test_behind_what_is_opaque_nothing_is_counted() -> None:
    front = ball((0.0, 0.0, 1.0), 1.5, opacity=1.0)
    layers = Gaussians.concatenate([ball((0.0, 0.0, 1.0 + 0.1 * i), 1.5, opacity=1.0) for i in range(5)])
    assert overdraw(front, view())[13, 21] == 1
    assert overdraw(layers, view())[13, 21] == 2, "0.001 of the light is left behind the first, negligible after"


def test_a_body_is_seen_where_a_sphere_is() -> None:
    camera, center, radius = view(), np.array([0.15, -0.1, 1.6]), 0.4
    image, depths = ellipsoids(ball((0.15, -0.1, 1.6), radius), camera, BACKGROUND)
    y, x = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1)
    along, squared = rays @ center, (rays * rays).sum(-1)
    inside = along**2 - squared * (center @ center - radius**2)
    is_hit = inside > 0
    np.testing.assert_array_equal(np.isfinite(depths), is_hit)
    expected = (along[is_hit] - np.sqrt(inside[is_hit])) / squared[is_hit]
    np.testing.assert_allclose(depths[is_hit], expected, rtol=1e-5)
    np.testing.assert_allclose(image[~is_hit], np.broadcast_to(BACKGROUND, image[~is_hit].shape), rtol=1e-6)
    shades = image[is_hit] / np.array([0.8, 0.4, 0.2])
    np.testing.assert_allclose(shades, shades[:, :1].repeat(3, 1), rtol=1e-4, err_msg="only the light differs")
    assert AMBIENT - 1e-4 <= shades.min() < shades.max() <= 1.0 + 1e-4


def test_the_nearer_body_hides_the_other_one_in_any_order() -> None:
    near, far = ball((0.0, 0.0, 1.0), 0.2), ball((0.0, 0.0, 3.0), 1.0)
    one = ellipsoids(Gaussians.concatenate([near, far]), view(), BACKGROUND)
    other = ellipsoids(Gaussians.concatenate([far, near]), view(), BACKGROUND)
    np.testing.assert_array_equal(one[0], other[0])
    assert one[1][13, 21] == pytest.approx(0.8, abs=1e-3)


def test_a_turned_body_lies_as_its_quaternion_says() -> None:
    half = np.sqrt(0.5)
    long_in_x = Gaussians(
        torch.tensor([[0.0, 0.0, 2.0]]),
        torch.tensor([[1.0, 0.0, 0.0, 0.0]]),
        torch.tensor([[0.4, 0.05, 0.05]]),
        torch.tensor([0.9]),
        torch.ones(1, 3),
    )
    turned = Gaussians(long_in_x.means, torch.tensor([[half, 0.0, 0.0, half]]).float(), *long_in_x.tensors()[2:])
    for gaussians, is_wide in ((long_in_x, True), (turned, False)):
        rows, columns = np.nonzero(np.isfinite(ellipsoids(gaussians, view(), BACKGROUND)[1]))
        assert (np.ptp(columns) > 3 * np.ptp(rows)) == is_wide
        assert (np.ptp(rows) > 3 * np.ptp(columns)) != is_wide


def test_rows_that_cannot_be_drawn_change_nothing() -> None:
    mixed, camera = spoiled(), view()
    rows = torch.tensor([10, 11])
    np.testing.assert_array_equal(overdraw(mixed, camera), overdraw(mixed[rows], camera))
    for found, expected in zip(
        ellipsoids(mixed, camera, BACKGROUND), ellipsoids(mixed[rows], camera, BACKGROUND), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("gaussians", [cloud(0), ball((0.0, 0.0, -2.0), 0.5), ball((0.0, 0.0, 0.1), 0.5)])
def test_where_nothing_can_be_seen_the_background_is(gaussians: Gaussians) -> None:
    """No Gaussians at all, one behind the camera, and one around it, which has no body that could be seen whole."""
    image, depths = ellipsoids(gaussians, view(), BACKGROUND)
    assert np.isinf(depths).all()
    np.testing.assert_allclose(image, np.broadcast_to(BACKGROUND, image.shape), rtol=1e-6)
    if not len(gaussians) or gaussians.means[0, 2] < 0:
        assert not overdraw(gaussians, view()).any()
