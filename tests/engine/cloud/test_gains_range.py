"""White balance recovery, near planes and depth ranges, voxel means."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.depth_range import depth_ranges, near_plane
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import (
    MIN_SPREAD,
    GainSpread,
    gain_spread,
    gains_from_observations,
    gains_from_pictures,
    in_gauge,
)
from engine.cloud.median import median_over_cameras
from engine.cloud.voxel import voxel_keys, voxel_means


def ring_rig(n_cameras: int = 8, radius: float = 3.0) -> CameraRig:
    """Cameras on a circle that all look at the origin."""
    poses = []
    for angle in np.linspace(0.0, 2 * np.pi, n_cameras, endpoint=False):
        center = radius * np.array([np.cos(angle), 0.0, np.sin(angle)])
        forward = -center / radius
        down = np.array([0.0, 1.0, 0.0])
        rotation = np.stack([np.cross(down, forward), down, forward])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
        poses.append(pose)
    K = np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]])
    return CameraRig(
        names=tuple(f"cam{i}" for i in range(n_cameras)),
        world_to_camera=np.stack(poses),
        Ks=np.repeat(K[None], n_cameras, axis=0),
        image_sizes=np.repeat([[160, 120]], n_cameras, axis=0),
    )


def test_near_plane_scales_with_the_rig() -> None:
    small, large = near_plane(ring_rig(radius=3.0)), near_plane(ring_rig(radius=30.0))
    assert small == pytest.approx(0.6, rel=0.02)  # a fifth of the distance; the focus point is damped by 0.1 %
    assert large == pytest.approx(10 * small, rel=1e-6)


def test_depth_ranges_without_points_follow_the_focus_distance() -> None:
    near, far = depth_ranges(ring_rig(), None)
    assert np.allclose(near, 2.1, rtol=0.02)
    assert np.allclose(far, 9.0, rtol=0.02)


def test_depth_ranges_enclose_sparse_points_but_not_the_near_plane() -> None:
    rig = ring_rig()
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (400, 3))
    near, far = depth_ranges(rig, points)
    assert ((near > 1.5) & (near < 2.6)).all()
    assert ((far > 3.4) & (far < 5.0)).all()
    at_the_lens = rig.centers[0] + 1e-3 * np.random.default_rng(1).normal(size=(400, 3)) + 0.05 * rig.forwards[0]
    assert depth_ranges(rig, at_the_lens)[0][0] >= near_plane(rig)


def test_gains_are_recovered_from_points_seen_by_some_cameras() -> None:
    rng = np.random.default_rng(0)
    scene = rng.uniform(20.0, 200.0, (600, 3))
    gains = np.exp(rng.normal(0.0, 0.15, (6, 3)))
    gains /= np.exp(np.median(np.log(gains), axis=0))
    seen = np.log(gains[:, None] * scene[None] + 1.0)
    seen[rng.random((6, 600)) < 0.5] = np.nan
    wrong = rng.random((6, 600)) < 0.1
    seen[wrong] = np.log(rng.uniform(1.0, 255.0, (int(wrong.sum()), 3)))  # occlusions
    found, colors = gains_from_observations(seen, np.ones((6, 3)))
    # log(c + 1) bends a pure gain by up to (gain - 1) / 21 for the darkest points; medians over 300 points
    assert np.abs(found / gains - 1.0).max() < 0.02
    assert np.allclose(np.median(np.log(found), axis=0), 0.0, atol=1e-9)
    is_known = np.isfinite(colors[:, 0])
    assert np.median(np.abs(colors[is_known] / scene[is_known] - 1.0)) < 0.02


def observe(log_gains: np.ndarray, *, noise: float, tilt: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and log colours for cameras of these gains.

    Args:
        log_gains: [C, 3]
        noise: RMS of the log colours.
        tilt: How much brighter each camera sees one end of the scene than the other, at random, in log colour: like
            shading that depends on the view, no gain explains it.
    """
    rng = np.random.default_rng(0)
    points = rng.normal(size=(2000, 3)) * [3.0, 2.0, 1.0]
    scene = np.log(rng.uniform(20.0, 200.0, (2000, 3)))
    seen = scene + log_gains[:, None] + rng.normal(0.0, noise, (len(log_gains), 2000, 3))
    seen += tilt * rng.choice([-1.0, 1.0], (len(log_gains), 1, 1)) * (points[:, :1] > 0)
    seen[rng.random(seen.shape[:2]) < 0.3] = np.nan
    return points, seen


def test_cameras_that_differ_are_told_from_cameras_that_do_not() -> None:
    log_gains = np.random.default_rng(1).normal(0.0, 0.1, (8, 3))
    measured = gain_spread(*observe(log_gains, noise=0.05))
    assert measured.n_cameras == 8
    assert measured.spread == pytest.approx(log_gains.std(0, ddof=1).mean(), rel=0.2)
    assert measured.uncertainty < 0.01
    assert measured.is_real
    same = gain_spread(*observe(np.zeros((8, 3)), noise=0.5))
    assert same.spread < 0.03
    assert not same.is_real


def test_what_differs_from_place_to_place_is_no_gain() -> None:
    measured = gain_spread(*observe(np.zeros((8, 3)), noise=0.02, tilt=0.3))
    assert measured.spread > MIN_SPREAD  # it is its own uncertainty that keeps it from being real
    assert measured.uncertainty > 0.05
    assert not measured.is_real


def test_a_spread_that_nobody_sees_is_left_alone() -> None:
    log_gains = 0.002 * np.random.default_rng(1).normal(size=(8, 3))
    measured = gain_spread(*observe(log_gains, noise=1e-4))
    assert measured.spread > 5 * measured.uncertainty
    assert not measured.is_real


@pytest.mark.parametrize("n_points", [0, 1, 60])
def test_too_few_points_tell_nothing(n_points: int) -> None:
    points, seen = observe(np.full((4, 3), 0.1), noise=0.01)
    assert gain_spread(points[:n_points], seen[:, :n_points]) == GainSpread(0.0, float("inf"), 0)
    assert not gain_spread(points[:n_points], seen[:, :n_points]).is_real


def test_picture_gains_have_geometric_mean_one() -> None:
    pictures = (
        np.random.default_rng(0).uniform(10, 200, (4, 6, 8, 3)) * np.array([1.0, 1.2, 0.8, 1.1])[:, None, None, None]
    )
    gains = gains_from_pictures(pictures, np.ones((4, 6, 8), bool))
    assert np.allclose(np.exp(np.log(gains).mean(0)), 1.0)
    assert gains[1, 1] > gains[0, 1] > gains[2, 1]


def test_voxel_means_average_per_cell_and_conserve_weight() -> None:
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [-0.2, 0.1, 0.1]])
    weights = np.array([1.0, 3.0, 2.0])
    means, (column,), totals = voxel_means(points, 0.5, [np.array([[0.0], [4.0], [7.0]])], weights)
    assert np.allclose(means, [[-0.2, 0.1, 0.1], [0.25, 0.1, 0.1]])
    assert column.ravel().tolist() == [7.0, 3.0]
    assert totals.tolist() == [2.0, 4.0]


def test_voxel_keys_refuse_a_hopeless_grid() -> None:
    with pytest.raises(ValueError, match="voxels"):
        voxel_keys(np.array([[0.0, 0.0, 0.0], [1e9, 0.0, 0.0]]), 0.1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_median_over_cameras_is_that_of_the_finite_values(rng: np.random.Generator, dtype: type) -> None:
    samples = rng.random((5, 40, 3)).astype(dtype)
    samples[rng.random(samples.shape) < 0.4] = np.nan
    samples[:, 7] = np.nan  # seen by nobody
    samples[:, 8] = [[1.0], [np.inf], [3.0], [np.nan], [2.0]]
    finite = np.ma.masked_invalid(samples)
    expected = np.ma.median(finite, axis=0).filled(np.nan)
    found = median_over_cameras(samples)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, expected, rtol=1e-6)  # the mean of two values may round the other way


@pytest.mark.parametrize("n_cameras", [1, 6, 7])
def test_gains_in_their_gauge_have_a_median_of_1_and_the_ratios_they_had(n_cameras):
    gains = np.exp(np.random.default_rng(0).normal(0.2, 0.1, (n_cameras, 3))).astype(np.float32)
    found = in_gauge(gains)
    assert found.dtype == np.float32
    assert np.median(np.log(found.astype(np.float64)), axis=0) == pytest.approx(0.0, abs=1e-7)  # float32: 6e-8
    assert np.allclose(found / found[0], gains / gains[0], rtol=3e-7)
    assert np.allclose(in_gauge(found), found, rtol=1e-7)
