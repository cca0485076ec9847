"""Turntables stay on their circle and look at its middle; fly-throughs go from camera to camera on a short way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.camera.path_presets import fly_through, turntable, visiting_order
from engine.camera.projection import camera_center
from engine.camera.rig import CameraRig

CENTER, UP = np.array([1.0, -2.0, 0.5]), np.array([0.0, 0.0, 2.0])
RIG = make_rig(12, (80, 60))


def test_a_turntable_stays_on_its_circle_and_looks_at_the_middle():
    path = turntable(CENTER, UP, 3.0, 0.4, (10, 50), start=np.array([0.0, 1.0, 5.0]))
    assert path.is_closed
    assert path.frame_range == (10.0, 50.0)
    matrices, _ = path.poses(np.linspace(10, 50, 400))
    for matrix in matrices:
        offset = camera_center(matrix) - CENTER
        assert np.linalg.norm(offset) == pytest.approx(3.0, rel=1e-3)
        assert offset[2] == pytest.approx(3.0 * math.sin(0.4), rel=1e-3)
        seen = matrix[:3, :3] @ CENTER + matrix[:3, 3]
        assert np.abs(seen[:2]).max() < 0.01
        assert matrix[1, :3] @ UP < 0, "upside down"
    first = camera_center(path.at(10)[0]) - CENTER
    assert np.allclose(first[:2] / np.linalg.norm(first[:2]), (0, 1))


def test_turns_go_the_way_that_is_asked_and_close_only_when_whole():
    for n_turns in (1, -1, 3, 0.5, -0.25):
        path = turntable(CENTER, UP, 2.0, 0.0, (0, 100), n_turns)
        centers = path.centers(np.linspace(0, 99.999, 800)) - CENTER
        angles = np.unwrap(np.arctan2(centers[:, 1], centers[:, 0]))
        assert (angles[-1] - angles[0]) / (2 * math.pi) == pytest.approx(n_turns, abs=0.01)
        assert path.is_closed == float(n_turns).is_integer()


def test_straight_from_above_it_is_still_a_view():
    path = turntable(CENTER, UP, 2.0, math.pi / 2, (0, 10))
    matrices, _ = path.poses(np.linspace(0, 10, 30))
    assert np.isfinite(matrices).all()


@pytest.mark.parametrize(
    "changed",
    [{"radius": 0.0}, {"radius": math.nan}, {"up": np.zeros(3)}, {"n_turns": 0.0}, {"frames": (5, 5)}],
)
def test_what_is_not_a_turntable_is_refused(changed):
    values = {"center": CENTER, "up": UP, "radius": 1.0, "elevation": 0.0, "frames": (0, 10), "n_turns": 1.0}
    with pytest.raises(ValueError, match="turntable"):
        turntable(**(values | changed))


def test_a_fly_through_visits_every_camera_once_from_end_to_end():
    path = fly_through(RIG, (5, 25))
    assert len(path.keys) == len(RIG)
    assert path.frame_range == (5.0, 25.0)
    centers = np.stack([key.center for key in path.keys])
    away = np.linalg.norm(centers[:, None] - RIG.centers[None], axis=-1)
    assert sorted(np.argmin(away, axis=1).tolist()) == list(range(len(RIG)))
    speeds = np.linalg.norm(np.diff(centers, axis=0), axis=1) / np.diff([key.frame for key in path.keys])
    assert np.allclose(speeds, speeds[0]), "not at an even pace"


def test_the_way_through_shuffled_cameras_is_as_short_as_along_the_arc():
    angles = np.linspace(0, 4.5, 30)
    arc = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    shuffled = np.random.default_rng(0).permutation(30)
    order = visiting_order(arc[shuffled])
    visited = shuffled[order].tolist()
    assert visited in (list(range(30)), list(range(29, -1, -1)))


def test_pieces_that_cross_are_turned_round():
    random = np.random.default_rng(4)
    centers = random.uniform(0, 1, (40, 3))
    order = visiting_order(centers)
    assert sorted(order) == list(range(40))
    length = np.linalg.norm(np.diff(centers[order], axis=0), axis=1).sum()
    for i in range(40):
        for j in range(i + 1, 40):
            turned = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
            assert np.linalg.norm(np.diff(centers[turned], axis=0), axis=1).sum() >= length - 1e-9


def test_cameras_at_one_place_and_a_single_camera_make_a_path_too():
    same = CameraRig(("a", "b"), np.repeat(RIG.world_to_camera[:1], 2, axis=0), RIG.Ks[:2], RIG.image_sizes[:2])
    assert [key.frame for key in fly_through(same, (0, 9)).keys] == [0.0, 9.0]
    assert len(fly_through(RIG.subset([0]), (0, 9)).keys) == 1
    with pytest.raises(ValueError, match="camera"):
        fly_through(RIG.subset([]), (0, 9))


@pytest.mark.parametrize("n_quarters", [1, 2, 3])
def test_a_camera_on_its_side_is_turned_upright_with_its_lens(n_quarters):
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turn = np.eye(4)
    turn[:3, :3] = np.linalg.matrix_power(quarter, n_quarters)
    matrices = RIG.world_to_camera.copy()
    matrices[3] = turn @ matrices[3]
    turned = CameraRig(RIG.names, matrices, RIG.Ks, RIG.image_sizes)
    straight, path = fly_through(RIG, (0, 30)), fly_through(turned, (0, 30))
    for one, other in zip(straight.keys, path.keys, strict=True):
        assert np.allclose(one.world_to_camera, other.world_to_camera, atol=1e-9)
