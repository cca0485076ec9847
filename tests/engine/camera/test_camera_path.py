"""Camera paths: keys are reached, nothing swings out or turns back, loops close."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.projection import camera_center
from engine.errors import ProjectError


def key(frame: float, center=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), fov: float = 0.8) -> CameraKey:
    """A key at a place, turned by a rotation vector, camera to world."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(turn).as_matrix().T
    matrix[:3, 3] = -matrix[:3, :3] @ np.array(center)
    return CameraKey(frame, matrix, fov)


def random_path(seed: int, *, n_keys: int = 6, is_closed: bool = False) -> CameraPath:
    random = np.random.default_rng(seed)
    frames = np.cumsum(random.uniform(0.2, 20.0, n_keys))
    keys = [key(frame, random.normal(0, 3, 3), random.normal(0, 0.7, 3), random.uniform(0.2, 2.0)) for frame in frames]
    return CameraPath("random", tuple(keys), is_closed)


@pytest.mark.parametrize("is_closed", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_every_key_is_reached_at_its_frame(seed, is_closed):
    path = random_path(seed, is_closed=is_closed)
    for one in path.keys:
        matrix, fov = path.at(one.frame)
        assert np.allclose(matrix, one.world_to_camera, atol=1e-9)
        assert fov == pytest.approx(one.fov_y_rad)


@pytest.mark.parametrize("seed", range(20))
def test_between_two_keys_the_camera_only_goes_forward(seed):
    path = random_path(seed)
    for one, other in itertools.pairwise(path.keys):
        frames = np.linspace(one.frame, other.frame, 200)
        along = path.centers(frames) @ (other.center - one.center)
        assert (np.diff(along) > -1e-9).all(), "it turns back, or runs past a key"
        fovs = path.poses(frames)[1]
        low, high = sorted((one.fov_y_rad, other.fov_y_rad))
        assert (fovs >= low - 1e-9).all()
        assert (fovs <= high + 1e-9).all()


@pytest.mark.parametrize("is_closed", [False, True])
def test_place_and_direction_have_no_kinks(is_closed):
    path = random_path(7, is_closed=is_closed)
    inner = path.keys if is_closed else path.keys[1:-1]
    step = 1e-5
    for one in inner:
        matrices, fovs = path.poses(one.frame + step * np.array([-2.0, -1.0, 1.0, 2.0]))
        centers = np.stack([camera_center(matrix) for matrix in matrices])
        assert np.allclose(centers[1] - centers[0], centers[3] - centers[2], atol=1e-3 * step)
        rotations = Rotation.from_matrix(matrices[:, :3, :3])
        turns = [(rotations[b] * rotations[a].inv()).as_rotvec() for a, b in ((0, 1), (2, 3))]
        assert np.allclose(turns[0], turns[1], atol=1e-3 * step)
        assert math.log(fovs[1] / fovs[0]) == pytest.approx(math.log(fovs[3] / fovs[2]), abs=1e-3 * step)


def test_two_keys_are_joined_by_a_straight_line_and_an_even_turn():
    path = CameraPath("line", (key(10, (0, 0, 0), fov=0.4), key(20, (2, 0, 0), (0, 1.2, 0), fov=1.6)))
    matrix, fov = path.at(15)
    assert np.allclose(camera_center(matrix), (1, 0, 0))
    assert np.allclose(Rotation.from_matrix(matrix[:3, :3].T).as_rotvec(), (0, 0.6, 0))
    assert fov == pytest.approx(0.8), "a lens changes by factors"


def test_before_the_first_and_after_the_last_key_it_stands_still():
    path = random_path(3)
    for frame, one in ((-100.0, path.keys[0]), (1e6, path.keys[-1])):
        assert np.allclose(path.at(frame)[0], one.world_to_camera, atol=1e-9)
    assert path.frame_range == (path.keys[0].frame, path.keys[-1].frame)


def test_equal_keys_stand_still_however_fast_it_goes_around_them():
    path = CameraPath("pause", (key(0), key(5, (9, 0, 0)), key(10, (9, 0, 0)), key(11, (0, 5, 0), (0, 2, 0))))
    matrices, _ = path.poses(np.linspace(5, 10, 50))
    assert np.allclose(matrices, path.keys[1].world_to_camera, atol=1e-12)


def test_a_loop_goes_round_and_round_both_ways():
    path = random_path(11, is_closed=True)
    period = path.period_frames
    assert period is not None
    span = path.keys[-1].frame - path.keys[0].frame
    assert period == pytest.approx(span * 6 / 5), "the way back takes the mean time from key to key"
    frames = np.linspace(path.keys[0].frame, path.keys[0].frame + period, 40)
    for shift in (-2 * period, period):
        assert np.allclose(path.poses(frames + shift)[0], path.poses(frames)[0], atol=1e-6)
    middle = path.centers([path.keys[-1].frame + period / 12])[0]
    assert np.linalg.norm(middle - path.keys[-1].center) > 0.01


@pytest.mark.parametrize("is_closed", [False, True])
def test_a_single_key_is_a_camera_that_stands(is_closed):
    path = CameraPath("one", (key(4, (1, 2, 3), fov=0.5),), is_closed)
    matrix, fov = path.at(999.5)
    assert np.allclose(camera_center(matrix), (1, 2, 3))
    assert fov == pytest.approx(0.5)


def test_a_path_without_keys_says_so():
    with pytest.raises(ProjectError, match="has no keys"):
        CameraPath("empty").at(0)


def test_what_is_not_a_key_or_not_a_path_is_refused():
    skewed = np.eye(4)
    skewed[0, 1] = 0.1
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    far = np.eye(4)
    far[0, 3] = 1e300
    for matrix in (skewed, mirrored, far, 1e200 * skewed, np.eye(3), np.full((4, 4), np.nan), np.zeros((4, 4))):
        with pytest.raises(ValueError, match="pose"):
            CameraKey(0.0, matrix, 0.8)
    for frame, fov in ((math.nan, 0.8), (math.inf, 0.8), (0.0, 0.0), (0.0, 4.0), (0.0, math.nan)):
        with pytest.raises(ValueError, match=r"frame|field of view"):
            CameraKey(frame, np.eye(4), fov)
    for frames in ((1.0, 0.0), (1.0, 1.0)):
        with pytest.raises(ValueError, match="order"):
            CameraPath("wrong", tuple(key(frame) for frame in frames))
    with pytest.raises(ValueError, match="no name"):
        CameraPath("  ")


def test_keys_do_not_share_memory_with_those_who_made_them():
    matrix = np.eye(4)
    one = CameraKey(0.0, matrix, 0.8)
    matrix[0, 3] = 7.0
    assert one.center[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        one.world_to_camera[0, 3] = 1.0
    assert np.allclose(one.at_center(np.array([1.0, 2.0, 3.0])).center, (1, 2, 3))
