"""Points inside the hull of a ball that comes in the second frame, seen from a ring of cameras."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.gate.inside import frames_inside
from engine.synthetic.scene import make_rig

CENTER, RADIUS = np.array([0.1, -0.2, 0.6]), 0.3
N_FRAMES = 3


def masks_of(rig: CameraRig) -> np.ndarray:
    """The ball's outlines: nothing, the ball, the ball. [M, C, H, W]"""
    width, height = rig.image_sizes[0]
    masks = np.zeros((N_FRAMES, len(rig), height, width), dtype=bool)
    for camera, world_to_camera in enumerate(rig.world_to_camera):
        center = world_to_camera[:3, :3] @ CENTER + world_to_camera[:3, 3]
        K = rig.Ks[camera]
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        rays = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], axis=-1)
        along = rays @ center / (rays**2).sum(axis=-1)
        masks[1:, camera] = np.linalg.norm(rays * along[..., None] - center, axis=-1) < RADIUS
    return masks


@pytest.mark.parametrize("n_cameras", [5, 12])
def test_what_the_ball_covers_is_inside_in_its_frames_and_nothing_beside_it(n_cameras):
    rig = make_rig(n_cameras, (80, 60))
    masks = masks_of(rig)
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    within, beyond = CENTER + 0.8 * RADIUS * directions, CENTER + 2.0 * RADIUS * directions
    assert (frames_inside(within, masks, rig) == 2).all()
    assert (frames_inside(beyond, masks, rig) == 0).all()


def test_one_camera_may_be_wrong_where_there_are_many():
    for n_cameras, n_frames in ((7, 0), (8, 2)):
        rig = make_rig(n_cameras, (80, 60))
        masks = masks_of(rig)
        masks[:, 3] = False
        assert frames_inside(CENTER[None], masks, rig).tolist() == [n_frames]
        masks[:, 4] = False
        assert frames_inside(CENTER[None], masks, rig).tolist() == [0]


def test_a_place_that_nobody_looks_at_is_not_inside():
    rig = make_rig(8, (80, 60))
    assert frames_inside(np.array([[0.0, 0.0, 50.0]]), np.ones_like(masks_of(rig)), rig).tolist() == [0]
