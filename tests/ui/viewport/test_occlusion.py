"""Marks behind what the picture shows."""

from __future__ import annotations

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from ui.viewport.layers.occlusion import OcclusionMap

WIDTH, HEIGHT = 640, 480
K = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
POSE = np.eye(4)


def wall(depth: float, *, left: float = -3.0, right: float = 3.0, opacity: float = 1.0, key: str = "wall"):
    """A wall of Gaussians before a camera at the origin that looks along z."""
    x, y = np.meshgrid(np.linspace(left, right, 240), np.linspace(-2.5, 2.5, 180))
    means = np.stack([x.ravel(), y.ravel(), np.full(x.size, depth)], axis=-1).astype(np.float32)
    n = len(means)
    return GaussianArrays(
        means=means,
        quats=np.tile(np.array([1, 0, 0, 0], np.float32), (n, 1)),
        scales=np.full((n, 3), 0.02, np.float32),
        opacities=np.full(n, opacity, np.float32),
        colors=np.zeros((n, 3), np.float32),
        key=key,
    )


def hidden(points: list[list[float]], gaussians: GaussianArrays) -> list[bool]:
    positions = np.array(points, np.float32)
    return OcclusionMap().hidden(positions, gaussians, POSE, K, WIDTH, HEIGHT).tolist()


def test_marks_behind_a_wall_are_hidden_and_those_on_it_and_before_it_are_not() -> None:
    assert hidden([[0, 0, 1], [0, 0, 2], [0.3, 0.2, 2.05], [0, 0, 4]], wall(2.0)) == [False, False, False, True]


def test_beside_the_wall_out_of_the_picture_and_behind_the_eye_nothing_is_hidden() -> None:
    half = wall(2.0, right=0.0)
    assert hidden([[-1, 0, 4], [1.5, 0, 4], [30, 0, 4], [0, 0, -4]], half) == [True, False, False, False]


def test_what_is_nearly_transparent_hides_nothing() -> None:
    assert hidden([[0, 0, 4]], wall(2.0, opacity=0.1)) == [False]


def test_another_scene_is_looked_at_anew() -> None:
    occlusion, mark = OcclusionMap(), np.array([[0, 0, 4.0]], np.float32)
    assert occlusion.hidden(mark, wall(2.0), POSE, K, WIDTH, HEIGHT)[0]
    assert not occlusion.hidden(mark, wall(5.0, key="other"), POSE, K, WIDTH, HEIGHT)[0]


def test_how_far_away_an_orthographic_camera_stands_says_nothing_about_what_is_hidden() -> None:
    """The same wall and marks, seen from ten thousand units farther away through a lens as much longer."""
    far = 10_000.0
    pose, long = POSE.copy(), K.copy()
    pose[2, 3] += far
    long[[0, 1], [0, 1]] *= far / 2.0
    marks = np.array([[0, 0, 1], [0, 0, 2], [0, 0, 4]], np.float32)
    found = OcclusionMap().hidden(marks, wall(2.0), pose, long, WIDTH, HEIGHT, near=far, set_back=far)
    assert found.tolist() == [False, False, True]
    cut = OcclusionMap().hidden(marks, wall(2.0), pose, long, WIDTH, HEIGHT, near=far + 3.0, set_back=far)
    assert not cut.any(), "a wall that is cut off hides nothing"
