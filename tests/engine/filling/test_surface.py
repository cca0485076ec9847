"""Surfaces go on exactly where they are planes, and new Gaussians lie on them in the right colours."""

import numpy as np
import pytest

from engine.editing.fills.fill import FillGaussians
from engine.editing.selection.seen_from import SeenFrom
from engine.filling.continuing import continued_colors, continued_depth
from engine.filling.pictures import DepthPicture, Taken, holes_of, pixels_of, points_at
from engine.filling.surface import surface_behind

WIDTH, HEIGHT = 64, 48
K = np.array([[60.0, 0.0, 32.0], [0.0, 60.0, 24.0], [0.0, 0.0, 1.0]])
NORMAL, DISTANCE = np.array([0.2, -0.3, -1.0]) / np.linalg.norm([0.2, -0.3, -1.0]), -3.0
"""A plane: NORMAL . x = DISTANCE."""


def camera(x: float) -> SeenFrom:
    pose = np.eye(4)
    pose[0, 3] = -x
    return SeenFrom(pose, K, WIDTH, HEIGHT)


def plane_depth(view: SeenFrom) -> np.ndarray:
    """Depth of the plane, pixel by pixel. [H, W] float64"""
    ys, xs = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    rays = np.stack([xs, ys, np.ones_like(xs)], axis=-1) @ np.linalg.inv(K).T
    center = -view.world_to_camera[:3, 3]
    return (DISTANCE - center @ NORMAL) / (rays @ NORMAL)


def hole(left: int = 20) -> np.ndarray:
    found = np.zeros((HEIGHT, WIDTH), bool)
    found[15:30, left : left + 18] = True
    return found


def taken(x: float, is_hole: np.ndarray) -> Taken:
    """A thing close to the camera is taken away from before a red plane, of which nothing is there in the hole."""
    view, color = camera(x), np.array([0.8, 0.2, 0.1], np.float32)
    depth = plane_depth(view)
    image = np.tile(color, (HEIGHT, WIDTH, 1))
    ones = np.ones((HEIGHT, WIDTH))
    before = DepthPicture(np.where(is_hole[..., None], 0.5, image), ones, np.where(is_hole, 1.0, depth))
    after = DepthPicture(np.where(is_hole[..., None], 0.0, image), ones * ~is_hole, np.where(is_hole, 0.0, depth))
    return Taken(view, before, after, is_hole, is_hole)


def test_a_plane_goes_on_exactly():
    depth, is_hole = plane_depth(camera(0.0)), hole()
    found = continued_depth(np.where(is_hole, 0.0, depth), is_hole)
    assert np.isnan(found[~is_hole]).all()
    np.testing.assert_allclose(found[is_hole], depth[is_hole], rtol=1e-12)


def test_a_hole_at_the_border_of_the_picture_goes_on_from_its_inner_sides():
    is_hole = np.zeros((HEIGHT, WIDTH), bool)
    is_hole[:, :10] = True
    found = continued_depth(np.full((HEIGHT, WIDTH), 4.0), is_hole)
    np.testing.assert_allclose(found[is_hole], 4.0)


def test_nothing_goes_on_from_nothing():
    everything = np.ones((HEIGHT, WIDTH), bool)
    assert np.isnan(continued_depth(np.full((HEIGHT, WIDTH), 4.0), everything)).all()
    assert np.isnan(continued_depth(np.zeros((HEIGHT, WIDTH)), hole())).all()


def test_colors_go_on():
    image = np.tile(np.array([0.8, 0.2, 0.1]), (HEIGHT, WIDTH, 1))
    image[hole()] = 0.0
    np.testing.assert_allclose(
        continued_colors(image, hole())[hole()], image[0, :1].repeat(270, 0), atol=4 / 255
    )  # it rounds pixel by pixel


def test_points_and_pixels_are_inverse():
    view, mask = camera(0.4), hole()
    rows, columns, depth = pixels_of(view, points_at(view, plane_depth(view), mask))
    np.testing.assert_array_equal(np.stack([rows, columns]), np.stack(mask.nonzero()))
    np.testing.assert_allclose(depth, plane_depth(view)[mask])


def test_what_lies_outside_of_a_picture_or_behind_it_has_no_depth():
    assert np.isnan(pixels_of(camera(0.0), np.array([[100.0, 0.0, 3.0], [0.0, 0.0, -3.0]]))[2]).all()


@pytest.fixture(scope="module")
def filled() -> FillGaussians:
    pictures = [taken(-0.05, hole(21)), taken(0.05, hole(19))]
    holes = holes_of(pictures)
    assert all((found == one.is_open).all() for found, one in zip(holes, pictures, strict=True))
    return surface_behind(pictures, holes, 0.06)


def test_new_gaussians_lie_on_the_plane(filled: FillGaussians):
    assert len(filled) > 50
    np.testing.assert_allclose(filled.means.astype(np.float64) @ NORMAL, DISTANCE, atol=1e-5)


def test_they_lie_flat_on_it(filled: FillGaussians):
    from engine.camera.rotations import matrices_of

    across = matrices_of(filled.quats.astype(np.float64))[..., filled.scales[0].argmin()]
    np.testing.assert_allclose(np.abs(across @ NORMAL), 1.0, atol=1e-4)


def test_they_have_its_colors_and_are_a_guess(filled: FillGaussians):
    np.testing.assert_allclose(filled.colors, np.tile([0.8, 0.2, 0.1], (len(filled), 1)), atol=4 / 255)
    assert filled.is_guess.mean() > 0.5  # those at the rim were seen


def test_a_surface_that_another_camera_sees_is_no_hole():
    is_hole = hole()
    whole = taken(0.0, is_hole)
    behind = DepthPicture(whole.after.image, np.ones((HEIGHT, WIDTH)), plane_depth(whole.view))
    sees_it = Taken(camera(0.0), behind, behind, np.zeros_like(is_hole), np.zeros_like(is_hole))
    asked = Taken(whole.view, whole.before, behind, is_hole, is_hole)
    assert not holes_of([asked, sees_it])[0].any()
    assert holes_of([asked])[0].any()  # no other camera: it was seen by none


def test_a_hole_that_would_float_before_a_wall_is_not_filled():
    is_hole = hole()
    one = taken(0.0, is_hole)
    far = DepthPicture(one.after.image, np.ones((HEIGHT, WIDTH)), np.full((HEIGHT, WIDTH), 9.0))
    others = [Taken(camera(x), far, far, np.zeros_like(is_hole), np.zeros_like(is_hole)) for x in (0.0, 0.01)]
    nothing = [np.zeros_like(is_hole)] * 2
    assert len(surface_behind([one, *others], [is_hole, *nothing], 0.06)) == 0


def test_a_dark_doorway_stays_dark():
    is_hole = hole()
    one = taken(0.0, is_hole)
    dark = DepthPicture(one.after.image, np.full((HEIGHT, WIDTH), 0.4), one.after.depth)
    assert not holes_of([Taken(one.view, one.before, dark, is_hole, is_hole)])[0].any()
