"""Colours of cameras: known for those trained on, suggested by place and direction for those held out."""

from dataclasses import replace

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.model.camera_colors import CameraColors, exposure_elsewhere

N = 12


def ring() -> CameraRig:
    """Cameras on two rings round the origin that look at it, one high and one low."""
    poses = []
    for i in range(N):
        angle, height = 2 * np.pi * i / N, -2.0 if i % 2 else 0.0
        center = np.array([3 * np.cos(angle), height, 3 * np.sin(angle)])
        forward = -center / np.linalg.norm(center)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
        poses.append(pose)
    K = np.array([[50.0, 0, 32], [0, 50, 24], [0, 0, 1]])
    names = tuple(f"cam{i:02d}" for i in range(N))
    return CameraRig(names, np.stack(poses), np.stack([K] * N), np.tile([64, 48], (N, 1)))


def colors(drift: np.ndarray | None) -> CameraColors:
    rig = ring()
    gains = np.linspace(0.8, 1.2, (N - 1) * 3).reshape(N - 1, 3).astype(np.float32)
    return CameraColors(rig.names[1:], gains, drift, 10)


def drift() -> np.ndarray:
    """High cameras hardly change, low ones darken over the clip. [C, M, 3]"""
    ends = np.where(np.arange(1, N) % 2, 1.0, 0.95)
    return np.linspace(np.ones(N - 1), ends, 10).T[:, :, None].repeat(3, 2).astype(np.float32)


def test_known_cameras_have_their_own_exposure_between_frames_too():
    own = colors(drift())
    np.testing.assert_allclose(own.exposure(ring(), 2, 0.9), drift()[1, 9])
    np.testing.assert_allclose(own.exposure(ring(), 2, 0.45), (drift()[1, 4] + drift()[1, 5]) / 2, rtol=1e-6)
    np.testing.assert_allclose(own.exposure(ring(), 2, 1.0), drift()[1, 9])  # beyond the last frame: as in it


def test_a_held_out_camera_follows_those_that_it_resembles():
    found = colors(drift()).exposure(ring(), 0, 0.9)  # a low one
    np.testing.assert_allclose(found, 0.95, atol=0.012)
    assert (colors(drift()).gain("cam00") == 1.0).all()


def test_what_is_suggested_stays_within_what_was_seen():
    known, seen = list(range(1, N)), np.ones((N - 1, 3), np.float32)
    seen[0] = 3.0
    found = exposure_elsewhere(ring(), known, seen, 0)
    assert ((found >= 1.0) & (found <= 3.0)).all()
    assert (exposure_elsewhere(ring(), [1], seen[1:2], 0) == 1.0).all()


def test_pictures_come_back_into_the_scenes_colours():
    own, image = colors(drift()), np.random.default_rng(0).random((48, 64, 3)) * 0.8
    camera = own.in_camera(image, ring(), 3, 0.9)
    pixels = np.floor(np.clip(camera, 0, 1) * 255 + 0.5).astype(np.uint8)
    np.testing.assert_allclose(own.rendition(ring(), 3, 0.9).to_scene(pixels) / 255.0, image, atol=0.01)


@pytest.mark.parametrize("camera", [0, 5])
def test_without_drift_exposure_is_one(camera):
    assert (colors(None).exposure(ring(), camera, 0.3) == 1.0).all()


def test_a_held_out_camera_has_the_vignetting_of_the_median_camera():
    lenses = np.array([[-0.1 * i, 0.01] for i in range(N - 1)], np.float32)
    own = replace(colors(None), vignetting=lenses)
    rig = ring()
    assert own.rendition(rig, 1, 0.0).vignetting == (0.0, np.float32(0.01))
    assert own.rendition(rig, 0, 0.0).vignetting == tuple(float(v) for v in lenses[(N - 1) // 2])
    center = own.rendition(rig, 2, 0.0).center
    assert center == (rig.Ks[2, 0, 2] / rig.image_sizes[2, 0], rig.Ks[2, 1, 2] / rig.image_sizes[2, 1])
