"""Light on what stands still: shadows are found on a floor, people in front of it and noise are not."""

import numpy as np
import pytest

from engine.camera.projection import pixel_rays, to_world
from engine.camera.rig import CameraRig
from engine.cloud.background.light import LARGEST_LOG, NO_CHANGE, AnchorLight, joined, met_by_plain, taken_over

N_CAMERAS, WIDTH, HEIGHT = 10, 160, 120
SHADOW, DARKER = 0.4, 0.85
"""Radius of the shadow, scene units, and what it leaves of the light; its rim is as wide as the radius."""


def ring() -> CameraRig:
    """Cameras on a ring 2 above a floor at y = 0 that look at its middle; y points down."""
    poses = []
    for i in range(N_CAMERAS):
        angle = 2 * np.pi * i / N_CAMERAS
        center = np.array([2.5 * np.cos(angle), -2.0, 2.5 * np.sin(angle)])
        forward = -center / np.linalg.norm(center)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
        poses.append(pose)
    K = np.array([[150.0, 0, WIDTH / 2], [0, 150.0, HEIGHT / 2], [0, 0, 1]])
    names = tuple(f"cam{i}" for i in range(N_CAMERAS))
    return CameraRig(names, np.stack(poses), np.stack([K] * N_CAMERAS), np.tile([WIDTH, HEIGHT], (N_CAMERAS, 1)))


def shadow(points: np.ndarray) -> np.ndarray:
    """Log brightness at places on the floor. [..., 3] -> [...]"""
    distance = np.linalg.norm(points[..., [0, 2]], axis=-1)
    return np.log(DARKER) * np.clip(2.0 - distance / SHADOW, 0.0, 1.0)


def pictures(light, seed: int) -> np.ndarray:
    """What the cameras take of the floor under a light, with noise of a grey level. [C, H, W, 3] uint8"""
    rig, rng = ring(), np.random.default_rng(seed)
    taken = []
    for camera in range(N_CAMERAS):
        rays = pixel_rays(rig.Ks[camera], WIDTH, HEIGHT)
        center = to_world(np.zeros(3), rig.world_to_camera[camera])
        directions = to_world(rays, rig.world_to_camera[camera]) - center
        floor = center - directions * (center[1] / directions[..., 1:2])
        texture = 120 + 60 * np.sin(3 * floor[..., :1]) * np.cos(4 * floor[..., 2:])
        colors = texture * [1.0, 0.9, 0.8] * np.exp(light(floor))[..., None]
        taken.append(np.clip(colors + rng.normal(0, 1, colors.shape) + 0.5, 0, 255).astype(np.uint8))
    return np.stack(taken)


def no_light(points: np.ndarray) -> np.ndarray:
    return np.zeros(points.shape[:-1])


def evenly(log_brightness: float):
    return lambda points: np.full(points.shape[:-1], log_brightness)


@pytest.fixture(scope="module")
def floor() -> np.ndarray:
    x, z = np.meshgrid(np.arange(-1.2, 1.21, 0.05), np.arange(-1.2, 1.21, 0.05))
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)


@pytest.fixture(scope="module")
def measure(floor) -> AnchorLight:
    return AnchorLight(floor, ring(), pictures(no_light, seed=0))


def frames(light, first_seed: int = 1):
    taken = [pictures(light, seed) for seed in range(first_seed, first_seed + 3)]
    return lambda row: [picture[row] for picture in taken]


def test_a_shadow_is_found_where_it_lies(measure, floor):
    found, true = measure.at(frames(shadow)), shadow(floor)
    inside, outside = true < 0.8 * np.log(DARKER), true == 0
    np.testing.assert_allclose(found[inside].mean(), true[inside].mean(), rtol=0.1)
    assert (found[outside & (np.linalg.norm(floor, axis=1) > 1.1)] == 0).mean() > 0.97
    assert np.abs(found - true).mean() < 0.01  # the rim is smoothed over two anchors


def test_where_no_light_changes_every_anchor_keeps_its_colours(measure):
    assert (measure.at(frames(no_light)) == 0).mean() > 0.99


@pytest.mark.slow
def test_people_in_front_of_some_cameras_are_no_light(measure):
    def with_people(row):
        taken = [picture.copy() for picture in frames(no_light)(row)]
        if row < 3:
            for picture in taken:
                picture[20:100, 50:110] = 40
        return taken

    assert (measure.at(with_people) == 0).mean() > 0.98


@pytest.mark.slow
def test_what_few_cameras_see_and_what_they_do_not_agree_on_stays(measure):
    at_odds = [pictures(evenly(0.2 * (row % 5 - 2)), 9)[row] for row in range(N_CAMERAS)]
    assert (measure.at(lambda row: [at_odds[row]]) == 0).all()
    assert (measure.at(lambda row: frames(shadow)(row) if row < 2 else []) == 0).all()


def test_anchors_behind_others_are_not_asked(floor):
    below = floor + np.array([0.0, 0.5, 0.0])
    both = AnchorLight(np.concatenate([floor, below]), ring(), pictures(no_light, seed=0)).at(frames(shadow))
    hidden = both[len(floor) :][np.linalg.norm(floor[:, [0, 2]], axis=1) < 0.5]
    assert (hidden == 0).mean() > 0.9


def test_black_and_white_pictures_say_nothing(measure):
    for level in (0, 255):
        picture = np.full((HEIGHT, WIDTH, 3), level, np.uint8)
        assert (measure.at(lambda row, picture=picture: [picture]) == 0).all()


def test_large_changes_are_bounded_and_small_ones_do_not_jump(measure):
    found = measure.at(frames(evenly(-0.65)))
    assert np.abs(found).max() <= LARGEST_LOG
    step = [np.median(measure.at(frames(evenly(by)))) for by in (0.004, 0.007)]
    assert step[0] == 0.0
    assert 0.0 < step[1] < 0.007
    assert NO_CHANGE < 0.007


def test_both_sides_of_a_border_are_joined_unless_the_light_was_switched():
    before, after = np.array([0.1, 0.1, 0.0], np.float32), np.array([0.11, 0.4, 0.0], np.float32)
    np.testing.assert_allclose(joined(after, before), [0.105, 0.1, 0.0], rtol=1e-6)
    np.testing.assert_allclose(joined(before, after), [0.105, 0.4, 0.0], rtol=1e-6)
    np.testing.assert_array_equal(taken_over(before, after), [before[0], after[1], before[2]], "no step, no look ahead")


def test_beside_the_reference_clip_light_begins_at_none_unless_it_was_switched():
    own = np.array([0.01, -0.015, 0.0, 0.4, -0.1], np.float32)
    np.testing.assert_array_equal(met_by_plain(own), np.array([0.0, 0.0, 0.0, 0.4, -0.1], np.float32))
