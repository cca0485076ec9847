"""Which camera's pyramid lies under the pointer."""

from __future__ import annotations

import numpy as np
import pytest

from app.playback.views.orbit_view import OrbitView
from tests.ui.fake_session import make_rig
from ui.gl.lines import frusta_lines
from ui.viewport.layers.frusta import camera_under, cameras_around, frustum_size

WIDTH, HEIGHT = 640, 480


def view_from_outside() -> OrbitView:
    view = OrbitView(make_rig())
    view.dolly(3.0)
    return view


def pixel_of(view: OrbitView, point: np.ndarray) -> tuple[float, float]:
    pose, K = view.world_to_camera(), view.K(WIDTH, HEIGHT)
    x, y, z = K @ (pose[:3, :3] @ point + pose[:3, 3])
    return x / z, y / z


def under(view: OrbitView, x: float, y: float) -> int | None:
    assert view.rig is not None
    return camera_under(view.rig, view.world_to_camera(), view.K(WIDTH, HEIGHT), x, y, near=0.01)


@pytest.mark.parametrize("camera", range(8))
def test_a_point_on_a_line_of_a_pyramid_is_that_camera(camera: int) -> None:
    view = view_from_outside()
    rig = view.rig
    assert rig is not None
    lines = frusta_lines(rig, frustum_size(rig))[0].reshape(len(rig), -1, 2, 3)
    start, end = lines[camera, 5].astype(np.float64)  # an edge of its picture
    assert under(view, *pixel_of(view, 0.5 * (start + end))) == camera


def test_the_pyramid_around_a_view_is_not_drawn_across_its_picture() -> None:
    view = view_from_outside()
    rig = view.rig
    assert rig is not None
    size = frustum_size(rig)
    assert not cameras_around(rig, view.world_to_camera(), size).any()
    around = cameras_around(rig, rig.world_to_camera[3], size)
    assert around.tolist() == [index == 3 for index in range(len(rig))]


def test_away_from_all_lines_there_is_none() -> None:
    view = view_from_outside()
    assert under(view, 5.0, 5.0) is None


def test_a_pyramid_behind_the_view_is_not_under_the_pointer() -> None:
    view = view_from_outside()
    eye, away = view.eye, view.pivot - view.eye
    assert any(under(view, float(x), HEIGHT / 2) is not None for x in range(0, WIDTH, 4))
    view.yaw += np.pi
    view.pitch = -view.pitch
    view.pivot = eye - away
    np.testing.assert_allclose(view.eye, eye, atol=1e-9)
    assert all(under(view, float(x), HEIGHT / 2) is None for x in range(0, WIDTH, 4))
