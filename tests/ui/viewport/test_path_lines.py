"""A camera path as lines, which key is meant by the pointer, and how drags and keys move one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.session.paths.path_commands import PlaceCameraKey
from engine.camera.camera_path import CameraPath
from engine.camera.path_presets import turntable
from engine.camera.projection import to_camera, to_pixels
from ui.viewport.layers.path_lines import LEAST_PER_PIECE, MOST_PER_PIECE, SAMPLES, key_pyramids, key_under, path_line
from ui.viewport.path_tool import PathTool, moved_in_view, nudged

LOOP = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.0, (0, 32))
K = np.array([[400.0, 0.0, 320.0], [0.0, 400.0, 240.0], [0.0, 0.0, 1.0]])
VIEW = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 0.0, 1.0]])
"""From six units away, along +y."""


def pixel(center: np.ndarray) -> np.ndarray:
    return to_pixels(to_camera(center[None], VIEW), K)[0]


def under(path: CameraPath, x: float, y: float) -> int | None:
    return key_under(path.keys, VIEW, K, x, y, near=0.1, reach_px=10.0)


def test_a_loop_is_drawn_back_to_where_it_begins_and_an_open_path_is_not():
    line = path_line(LOOP).reshape(-1, 2, 3)
    assert np.allclose(line[0, 0], line[-1, 1], atol=1e-6)
    assert np.allclose(line[1:, 0], line[:-1, 1]), "there are gaps"
    assert np.allclose(np.linalg.norm(line, axis=-1), 2.0, atol=0.01)
    opened = path_line(replace(LOOP, is_closed=False)).reshape(-1, 2, 3)
    assert np.allclose(opened[-1, 1], LOOP.keys[-1].center, atol=1e-6)
    assert len(path_line(CameraPath("one", LOOP.keys[:1]))) == 0


@pytest.mark.parametrize("n_keys", [2, 5, 16, 700])
def test_pieces_are_neither_beads_nor_corners(n_keys):
    keys = tuple(LOOP.keys[i % 16].at_frame(float(i)) for i in range(n_keys))
    n_pieces = len(path_line(CameraPath("long", keys))) // 2
    assert LEAST_PER_PIECE * (n_keys - 1) <= n_pieces <= MOST_PER_PIECE * (n_keys - 1)
    assert n_pieces <= max(SAMPLES, LEAST_PER_PIECE * (n_keys - 1))
    key_pyramids(keys, 0.1, chosen=n_keys - 1)  # the last one may have no pyramid


def test_the_nearest_key_in_sight_is_meant():
    for index in (0, 3, 9):
        x, y = pixel(LOOP.keys[index].center)
        found = under(LOOP, x + 3, y - 2)
        assert found is not None
        assert np.abs(pixel(LOOP.keys[found].center) - (x, y)).max() < 5.0
    assert under(LOOP, 20.0, 20.0) is None
    assert under(CameraPath("none"), 320.0, 240.0) is None
    behind = LOOP.keys[0].at_center(np.array([0.0, -9.0, 0.0]))
    assert under(CameraPath("behind", (behind,)), 320.0, 240.0) is None


def test_a_drag_keeps_the_key_under_the_pointer_or_goes_along_the_view():
    key = LOOP.keys[2]
    start = pixel(key.center)
    moved = moved_in_view(2, key, VIEW, K, 31.0, -17.0, is_along_view=False, gesture=4)
    assert isinstance(moved, PlaceCameraKey)
    assert (moved.index, moved.gesture) == (2, 4)
    assert np.allclose(pixel(np.array(moved.center)), start + np.array([31.0, -17.0]))
    along = moved_in_view(2, key, VIEW, K, 31.0, -17.0, is_along_view=True, gesture=4)
    assert along is not None
    assert np.allclose(np.array(along.center) - key.center, (0.0, 0.01 * 17 * (key.center[1] + 6.0), 0.0))
    behind = key.at_center(np.array([0.0, -9.0, 0.0]))
    assert moved_in_view(2, behind, VIEW, K, 1.0, 1.0, is_along_view=False, gesture=1) is None


def test_a_press_moves_by_a_share_of_the_distance():
    key = LOOP.keys[0].at_center(np.array([0.0, 4.0, 0.0]))
    moved = nudged(0, key, VIEW[:3, :3], np.array([0.0, -6.0, 0.0]), np.array([1.0, 0.0, 0.0]), gesture=1)
    assert np.allclose(moved.center, (0.2, 4.0, 0.0))


def test_presses_that_follow_each_other_are_one_step_back(monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr("ui.viewport.path_tool.time.monotonic", lambda: now_s[0])
    tool = PathTool()
    first = tool.press_gesture()
    now_s[0] += 0.5
    assert tool.press_gesture() == first
    now_s[0] += 5.0
    assert tool.press_gesture() > first > 0
