"""View arithmetic: rigid maps, framing, orbiting, looking through cameras."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.playback.views.orbit_view import OrbitView
from engine.camera.rig import CameraRig
from tests.app.fakes import look_at, ring

MOVES = st.lists(st.tuples(st.sampled_from(["orbit", "pan"]), st.floats(-800, 800), st.floats(-800, 800)), max_size=12)


def make_rig(n_cameras: int = 6, size: tuple[int, int] = (64, 48)) -> CameraRig:
    K = np.array([[60.0, 0.0, size[0] / 2 + 1.5], [0.0, 55.0, size[1] / 2 - 2.0], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i}" for i in range(n_cameras)),
        world_to_camera=np.stack(ring(n_cameras)),
        Ks=np.stack([K] * n_cameras),
        image_sizes=np.array([size] * n_cameras),
    )


def project(view: OrbitView, point: np.ndarray, width: int, height: int) -> np.ndarray:
    p_camera = view.world_to_camera() @ np.append(point, 1.0)
    assert p_camera[2] > 0
    return (view.K(width, height) @ p_camera[:3])[:2] / p_camera[2]


@given(MOVES, st.floats(0.01, 100.0))
def test_every_view_is_a_rigid_map(moves, factor):
    view = OrbitView(make_rig())
    for name, dx, dy in moves:
        getattr(view, name)(dx, dy)
    view.dolly(factor)
    matrix = view.world_to_camera()
    rotation = matrix[:3, :3]
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)  # a few roundings of unit vectors
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)
    assert np.allclose(matrix @ np.append(view.eye, 1.0), [0, 0, 0, 1], atol=1e-9 * (1 + np.abs(view.eye).max()))


@given(st.floats(-5000, 5000), st.floats(-5000, 5000))
def test_orbiting_keeps_distance_and_pivot(dx, dy):
    view = OrbitView(make_rig())
    pivot, distance = view.pivot.copy(), view.distance
    view.orbit(dx, dy)
    assert np.linalg.norm(view.eye - pivot) == pytest.approx(distance, rel=1e-12)
    assert np.array_equal(view.pivot, pivot)


@given(st.floats(-3000, 3000), st.floats(-3000, 3000))
def test_the_view_stays_upright(dx, dy):
    view = OrbitView(make_rig())
    view.orbit(dx, dy)
    down = view.world_to_camera()[1, :3]
    assert down @ view.up < 0


def test_home_frames_what_the_cameras_look_at():
    rig = make_rig()
    view = OrbitView(rig)
    view.orbit(400, 30)
    view.pan(90, -50)
    view.home()
    assert np.allclose(project(view, rig.focus_point(), 320, 240), [160, 120], atol=1e-6)
    assert view.distance < np.linalg.norm(rig.centers[0] - rig.focus_point())


def test_home_is_level_for_a_dome():
    eyes = [
        np.array([3 * math.cos(a) * math.cos(e), 3 * math.sin(a) * math.cos(e), 3 * math.sin(e)])
        for e in (0.2, 0.7, 1.2)
        for a in np.linspace(0, 2 * np.pi, 8, endpoint=False)
    ]
    rig = make_rig(len(eyes))
    poses = np.stack([look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])) for eye in eyes])
    view = OrbitView(CameraRig(rig.names, poses, rig.Ks, rig.image_sizes))
    assert view.pitch == pytest.approx(0.2, abs=1e-3)  # the lowest ring; the focus is damped by a thousandth


def test_up_comes_from_the_cameras():
    assert np.allclose(make_rig().up_direction(), [0, 0, 1], atol=1e-12)


def test_panning_moves_the_pivot_with_the_pointer():
    view = OrbitView(make_rig())
    held = view.pivot.copy()
    before = project(view, held, 640, 480)
    view.pan(37, -12)
    assert np.allclose(project(view, held, 640, 480) - before, [37, -12], atol=1e-6)


def test_dolly_ignores_nonsense_and_never_reaches_the_pivot():
    view = OrbitView(make_rig())
    distance = view.distance
    for factor in (0.0, -1.0, math.nan, math.inf):
        view.dolly(factor)
    assert view.distance == distance
    view.dolly(1e-30)
    assert view.distance > 0


@pytest.mark.parametrize("size", [(64, 48), (128, 96), (400, 96), (64, 300)])
def test_looking_through_a_camera_shows_its_whole_picture_centred(size):
    rig = make_rig()
    view = OrbitView(rig)
    view.look(2)
    assert np.array_equal(view.world_to_camera(), rig.world_to_camera[2])
    K = view.K(*size)
    scale = min(size[0] / 64, size[1] / 48)
    corners = [rig.Ks[2] @ [x, y, 1] for x, y in ((-0.5, -0.4), (0.5, 0.4))]
    for corner, ray in zip(corners, ((-0.5, -0.4), (0.5, 0.4)), strict=True):
        expected = scale * (corner[:2] - [32, 24]) + [size[0] / 2, size[1] / 2]
        assert np.allclose((K @ [*ray, 1])[:2], expected)


def test_leaving_a_camera_goes_on_from_where_it_stands():
    rig = make_rig()
    view = OrbitView(rig)
    view.look(3)
    view.look(None)
    # the camera stands upright in this rig, so nothing of its pose is lost
    assert np.allclose(view.world_to_camera(), rig.world_to_camera[3], atol=1e-9)
    assert np.allclose(view.pivot, rig.focus_point(), atol=0.05)  # its axis passes the damped focus point closely


def test_there_is_no_camera_beyond_the_last():
    with pytest.raises(ValueError, match="no camera 6"):
        OrbitView(make_rig()).look(6)
