"""The clip matrix is the projection by K, written as GL wants it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ui.gl.scenes import Camera, turned
from ui.gl.camera import clip_matrix, resized_K, uniform_matrix

angles = st.floats(-3.1, 3.1)
lengths = st.floats(-5.0, 5.0)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    width, height = draw(st.integers(1, 4000)), draw(st.integers(1, 4000))
    pose = np.eye(4)
    pose[:3, :3] = turned(draw(angles), draw(angles))
    pose[:3, 3] = [draw(lengths) for _ in range(3)]
    K = np.eye(3)
    K[0, 0], K[1, 1] = draw(st.floats(10, 9000)), draw(st.floats(10, 9000))
    K[0, 1] = draw(st.floats(-5, 5))
    K[0, 2], K[1, 2] = draw(st.floats(-0.5, 1.5)) * width, draw(st.floats(-0.5, 1.5)) * height
    return Camera(pose, K, width, height)


@given(camera=cameras(), x=st.floats(-3, 3), y=st.floats(-3, 3), depth=st.floats(0.02, 100))
def test_clip_matrix_equals_projection_by_K(camera: Camera, x: float, y: float, depth: float) -> None:
    in_camera = np.array([x * depth, y * depth, depth])
    rotation, translation = camera.world_to_camera[:3, :3], camera.world_to_camera[:3, 3]
    in_world = rotation.T @ (in_camera - translation)
    p_clip = clip_matrix(*camera.arguments) @ np.append(in_world, 1.0)
    pixel = (p_clip[:2] / p_clip[3] + 1) / 2 * (camera.width, camera.height)
    # float64 throughout; the division by a depth as small as 0.02 of coordinates of size 10 costs three digits, and
    # pixels reach 3 * 9000, so 1e-10 of that is what remains, with room to spare.
    np.testing.assert_allclose(pixel, camera.project(in_world[None])[0], atol=3e-6, rtol=1e-8)
    assert p_clip[3] == pytest.approx(depth, abs=1e-10)


@given(near=st.floats(1e-3, 10), factor=st.floats(1.5, 1e6))
def test_depth_is_minus_one_at_near_and_one_at_far(near: float, factor: float) -> None:
    far = near * factor
    matrix = clip_matrix(np.eye(4), np.eye(3), 8, 6, near=near, far=far)
    for z, expected in ((near, -1.0), (far, 1.0)):
        p_clip = matrix @ (0, 0, z, 1)
        assert p_clip[2] / p_clip[3] == pytest.approx(expected, abs=1e-9)


def test_infinite_far_plane_is_the_limit_of_a_far_one() -> None:
    infinite = clip_matrix(np.eye(4), np.eye(3), 8, 6, near=0.1)
    distant = clip_matrix(np.eye(4), np.eye(3), 8, 6, near=0.1, far=1e12)
    np.testing.assert_allclose(infinite, distant, rtol=1e-9)


@pytest.mark.parametrize(("near", "far"), [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0)])
def test_impossible_planes_are_refused(near: float, far: float) -> None:
    with pytest.raises(ValueError, match="near"):
        clip_matrix(np.eye(4), np.eye(3), 8, 6, near=near, far=far)


def test_empty_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="0 x 6"):
        clip_matrix(np.eye(4), np.eye(3), 0, 6)


@given(camera=cameras(), new_size=st.tuples(st.integers(1, 4000), st.integers(1, 4000)))
def test_resized_K_keeps_the_clip_matrix(camera: Camera, new_size: tuple[int, int]) -> None:
    resized = resized_K(camera.K, (camera.width, camera.height), new_size)
    np.testing.assert_allclose(
        clip_matrix(camera.world_to_camera, resized, *new_size), clip_matrix(*camera.arguments), rtol=1e-9, atol=1e-9
    )


def test_uniform_matrix_is_column_after_column() -> None:
    matrix = np.arange(16.0).reshape(4, 4)
    assert np.frombuffer(uniform_matrix(matrix), dtype=np.float32)[:4].tolist() == [0, 4, 8, 12]
