"""Which angle between two cameras a plane sweep aims for."""

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.cloud.stereo.sweep import BEST_ANGLES_DEG, preferred_angle_deg


def cone_rig(angle_deg: float, n_cameras: int = 8) -> CameraRig:
    """Cameras whose viewing directions all lie at one angle from their mean."""
    poses = np.tile(np.eye(4), (n_cameras, 1, 1))
    for pose, turn in zip(poses, np.linspace(0.0, 2 * np.pi, n_cameras, endpoint=False), strict=True):
        tilt = np.radians(angle_deg)
        forward = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    K = np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]])
    names = tuple(f"cam{i}" for i in range(n_cameras))
    return CameraRig(names, poses, np.repeat(K[None], n_cameras, axis=0), np.repeat([[160, 120]], n_cameras, axis=0))


@pytest.mark.parametrize("spread_deg", [24.0, 36.0, 48.0])
def test_the_angle_aimed_for_is_a_third_of_the_median_spread(spread_deg):
    assert preferred_angle_deg(cone_rig(spread_deg)) == pytest.approx(spread_deg / 3.0, rel=1e-9)


@pytest.mark.parametrize(("spread_deg", "expected"), [(1.0, BEST_ANGLES_DEG[0]), (85.0, BEST_ANGLES_DEG[1])])
def test_the_angle_aimed_for_stays_within_what_narrow_and_wide_rigs_need(spread_deg, expected):
    assert preferred_angle_deg(cone_rig(spread_deg)) == expected
