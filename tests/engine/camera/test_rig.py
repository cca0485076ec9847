"""Numbers of the rig: centres, directions, resizing, the focus point."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.lab.synthetic.rigs import FOCUS, looking_at, make_rig
from engine.camera.rig import CameraRig


def project(K: np.ndarray, world_to_camera: np.ndarray, point: np.ndarray) -> np.ndarray:
    x, y, z = world_to_camera[:3, :3] @ point + world_to_camera[:3, 3]
    return (K @ [x / z, y / z, 1.0])[:2]


def test_centers_are_what_the_poses_map_to_zero() -> None:
    rig = make_rig(5, (64, 48))
    for world_to_camera, center, forward in zip(rig.world_to_camera, rig.centers, rig.forwards, strict=True):
        assert np.allclose(world_to_camera @ [*center, 1.0], [0, 0, 0, 1], atol=1e-10)
        assert np.allclose(world_to_camera[:3, :3] @ forward, [0, 0, 1], atol=1e-10)


def test_subset_keeps_order_and_rows_together() -> None:
    rig = make_rig(4, (64, 48))
    part = rig.subset([2, 0])
    assert part.names == ("cam02", "cam00")
    assert np.array_equal(part.Ks[0], rig.Ks[2])
    assert np.array_equal(part.centers, rig.centers[[2, 0]])


@given(width=st.integers(1, 400), height=st.integers(1, 400))
def test_resizing_scales_pixel_positions_by_the_actual_ratio(width: int, height: int) -> None:
    rig = make_rig(2, (320, 240))
    small = rig.resized(np.array([[width, height]] * 2))
    point = np.array([0.3, -0.2, 0.7])
    for row in range(2):
        before = project(rig.Ks[row], rig.world_to_camera[row], point)
        after = project(small.Ks[row], small.world_to_camera[row], point)
        assert np.allclose(after, before * [width / 320, height / 240], rtol=1e-12)  # centres lie at +0.5
    assert np.allclose(small.resized(rig.image_sizes).Ks, rig.Ks, rtol=1e-12)


def test_focus_point_of_cameras_around_a_point_is_that_point() -> None:
    rig = make_rig(12, (320, 240))
    assert np.linalg.norm(rig.focus_point() - FOCUS) < 0.06  # the targets are scattered by up to 0.06 per axis


def test_focus_point_of_parallel_cameras_is_finite_and_in_front() -> None:
    poses = np.stack([looking_at(np.array([x, 0.0, 1.0]), np.array([x, 5.0, 1.0])) for x in (-1.0, 0.0, 1.0)])
    rig = CameraRig(("a", "b", "c"), poses, np.tile(np.eye(3), (3, 1, 1)), np.full((3, 2), 10))
    focus = rig.focus_point()
    assert np.isfinite(focus).all()
    assert focus[1] > 0.5  # forwards are +y; one rig radius ahead is 1.0
