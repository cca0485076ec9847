"""What a plane sweep compares: which angle between two cameras it aims for, with which sources, on which planes."""

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.camera.depth_range import depth_ranges
from engine.camera.projection import project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth.sweep import (
    BEST_ANGLES_DEG,
    WIDEST_ANGLE_DEG,
    choose_sources,
    matching_costs,
    plane_inverse_depths,
    preferred_angle_deg,
    relative_homography,
)


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


def test_cameras_far_apart_aim_for_more_than_those_that_stand_close():
    assert preferred_angle_deg(make_rig(20, (80, 60))) == BEST_ANGLES_DEG[1]
    sparse = preferred_angle_deg(make_rig(12, (80, 60)))
    assert 22.0 < sparse < 26.0  # three quarters of 32 degrees, the heights included
    assert sparse < preferred_angle_deg(make_rig(8, (80, 60))) <= WIDEST_ANGLE_DEG


# ---------------------------------------------------------------- sources and planes


def test_a_homography_moves_a_pixel_where_the_point_is_seen():
    rig = make_rig(4, (80, 60))
    matrix, shift = relative_homography(rig, 0, 1)
    depth, pixel = 3.0, np.array([20.5, 40.5])
    ray = np.linalg.inv(rig.Ks[0]) @ [*pixel, 1.0] * depth
    point = rig.world_to_camera[0, :3, :3].T @ (ray - rig.world_to_camera[0, :3, 3])
    expected, _ = project(point[None], projection_matrices(rig)[1])
    moved = matrix @ [*pixel, 1.0] + shift / depth
    assert moved[:2] / moved[2] == pytest.approx(expected[0])


def test_sources_are_neighbours_and_never_the_camera_itself():
    rig = make_rig(12, (80, 60))
    near, far = depth_ranges(rig, None)
    for camera, sources in enumerate(choose_sources(rig, near, far, n_sources=2)):
        steps = [min((other - camera) % 12, (camera - other) % 12) for other in sources]
        assert len(sources) == 2
        assert all(1 <= step <= 2 for step in steps), (camera, sources)  # of a ring: next to it, or one further


def test_a_camera_that_shares_nothing_with_others_has_no_sources():
    rig = cone_rig(10.0, 2)
    poses = rig.world_to_camera.copy()
    poses[1, :3, 3] = 1e6, 0.0, 0.0
    apart = CameraRig(rig.names, poses, rig.Ks, rig.image_sizes)
    assert choose_sources(apart, np.ones(2), np.full(2, 5.0)) == [[], []]


def test_planes_rise_evenly_and_move_what_sources_see_by_about_a_pixel_at_most():
    rig = make_rig(12, (80, 60))
    near, far = depth_ranges(rig, None)
    sources = choose_sources(rig, near, far)[0]
    planes = plane_inverse_depths(rig, 0, sources, near[0], far[0])
    assert planes[[0, -1]] == pytest.approx([1 / far[0], 1 / near[0]])
    assert np.allclose(np.diff(planes), np.diff(planes).mean(), rtol=1e-3)
    centre = np.array([40.0, 30.0, 1.0])
    for other in sources:
        matrix, shift = relative_homography(rig, 0, other)
        track = matrix @ centre + planes[:, None] * shift
        pixels = track[:, :2] / track[:, 2:]
        is_inside = np.all((pixels >= 0) & (pixels < [80, 60]), axis=1)
        steps = np.linalg.norm(np.diff(pixels, axis=0), axis=1)[is_inside[1:] & is_inside[:-1]]
        assert np.median(steps) < 1.0
        assert steps.max() < 1.5
    assert len(plane_inverse_depths(rig, 0, [], near[0], far[0])) == 25


# ---------------------------------------------------------------- costs


def test_costs_of_wanted_pixels_are_those_of_the_whole_picture():
    rig = make_rig(12, (84, 62))  # no multiple of a window
    greys = np.random.default_rng(0).uniform(0, 255, (12, 62, 84)).astype(np.float32)
    is_usable = np.ones(greys.shape, dtype=bool)
    is_usable[:, 10:14, 20:30] = False
    is_wanted = np.zeros((62, 84), dtype=bool)
    is_wanted[:3, :2] = is_wanted[30:37, 40:52] = is_wanted[61, 83] = is_wanted[11, 22:24] = True
    planes = np.linspace(0.2, 0.5, 9, dtype=np.float32)
    whole, some = (
        matching_costs(greys, is_usable, rig, camera=0, sources=[1, 2, 11], inverse_depths=planes, is_wanted=wanted)
        for wanted in (None, is_wanted)
    )
    assert np.abs(some - whole)[is_wanted].max() < 1e-3
    assert (some == 1.0).all(axis=-1).mean() > 0.7  # most of the picture was left out
    assert not (whole == 1.0).all(axis=-1)[is_wanted].all()
