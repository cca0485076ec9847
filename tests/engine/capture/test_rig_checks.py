"""Warnings about cameras taken together."""

from pathlib import Path

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.camera.rig import CameraRig
from engine.capture.cameras.rig_checks import check_rig, rig_extent, rig_warnings

RIG = make_rig(8, (80, 60))


def moved(rig: CameraRig, poses: np.ndarray) -> CameraRig:
    """The same cameras elsewhere."""
    return CameraRig(rig.names, poses, rig.Ks, rig.image_sizes)


def warnings(rig: CameraRig) -> str:
    """All of them."""
    return "\n".join(rig_warnings(rig, rig_extent(rig)))


def test_a_good_rig_is_not_worth_a_word():
    assert warnings(RIG) == ""
    assert check_rig(RIG, rig_extent(RIG), Path()) == []


def test_the_extent_is_the_largest_distance_of_two_cameras():
    expected = max(np.linalg.norm(a - b) for a in RIG.centers for b in RIG.centers)
    assert rig_extent(RIG) == pytest.approx(expected)
    assert rig_extent(RIG.subset([0])) == pytest.approx(0.0, abs=1e-7)


def test_inverted_poses_are_recognised():
    assert "camera-to-world" in warnings(moved(RIG, np.linalg.inv(RIG.world_to_camera)))


def test_a_camera_that_looks_away_is_named():
    poses = RIG.world_to_camera.copy()
    poses[3] = np.diag([-1.0, 1.0, -1.0, 1.0]) @ poses[3]  # turned about its own vertical axis
    assert f"face away from the scene: {RIG.names[3]}." in warnings(moved(RIG, poses))


def test_cameras_in_one_place_are_named_and_all_of_them_there_cannot_be_trained():
    poses = RIG.world_to_camera.copy()
    poses[5] = poses[2]
    assert "cam02 and cam05" in warnings(moved(RIG, poses))
    turned = poses.copy()
    turned[:, :3, 3] = 0.0
    (problem,) = check_rig(moved(RIG, turned), 0.0, Path())
    assert "All 8 cameras stand at one point (0, 0, 0)" in problem.message


def test_one_camera_and_several_sizes_are_said():
    assert "only one camera" in warnings(RIG.subset([0]))
    sizes = RIG.image_sizes.copy()
    sizes[0] = 40, 30
    assert "40x30, 80x60" in warnings(CameraRig(RIG.names, RIG.world_to_camera, RIG.Ks, sizes))
