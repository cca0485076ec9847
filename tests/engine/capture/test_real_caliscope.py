"""A real calibration of Caliscope: strong lenses, times of frames, and points that fall on their epipolar lines."""

from __future__ import annotations

import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from engine.capture.capture import open_capture
from engine.capture.layout.format_result import CameraEntry

FOLDER = Path(__file__).parents[4] / "shared" / "data" / "caliscope_4cam"
STATED_PX = 1.1
"""Median epipolar error on the moving board that its README states."""
MATCHED_PX = 8.0
"""Matches further off are of other points."""
FRAMES = (11, 29, 47)
MOVES = 0.04
"""Mean difference from the still picture where the person and the board are."""
LUMA = np.array([0.299, 0.587, 0.114], np.float32)
RATIO = 0.8
"""The best match must be so much nearer than the second."""


@pytest.fixture(scope="module")
def cameras() -> tuple[CameraEntry, ...]:
    if not FOLDER.is_dir():
        pytest.skip("the real capture ../shared/data/caliscope_4cam is not on this machine")
    capture = open_capture(FOLDER)
    assert capture.n_frames == 57
    assert abs(capture.fps - 6) < 0.01
    assert any("1.5 ms on average and 18.5 ms at worst" in warning for warning in capture.warnings)
    assert all(len(entry.lens.params) == 5 for entry in capture.layout.cameras)
    return capture.layout.cameras


@pytest.mark.slow
def test_the_moving_board_is_seen_as_its_calibration_says(cameras: tuple[CameraEntry, ...], tmp_path: Path) -> None:
    features = moving_features(cameras, tmp_path)
    with_lens = median_error_px(cameras, features, has_lens=True)
    without = median_error_px(cameras, features, has_lens=False)
    assert with_lens < 1.2 * STATED_PX
    assert without > 1.3 * with_lens  # the lenses are what makes it so


def moving_features(
    cameras: tuple[CameraEntry, ...], folder: Path
) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
    """SIFT features where something moves, by camera and frame."""
    grays, moving = {}, {}
    for row, entry in enumerate(cameras):
        pictures = np.stack([picture @ LUMA / 255 for picture in entry.source.read(FRAMES)])
        still = np.median(pictures, axis=0)
        for frame, picture in zip(FRAMES, pictures, strict=True):
            grays[f"{row}-{frame}"] = picture.astype(np.float32)
            moving[row, frame] = uniform_filter(np.abs(picture - still), 15) > MOVES
    np.savez(folder / "pictures.npz", **grays)
    child = [sys.executable, str(Path(__file__).parent / "sift_child.py"), "pictures.npz", "features.npz"]
    subprocess.run(child, cwd=folder, check=True, timeout=600, capture_output=True)
    found = {}
    with np.load(folder / "features.npz") as features:
        for (row, frame), mask in moving.items():
            xy = features[f"{row}-{frame}-xy"].astype(np.float64)
            columns, rows = xy.astype(int).clip(0, np.array(mask.shape[::-1]) - 1).T
            inside = mask[rows, columns]
            found[row, frame] = (xy[inside], features[f"{row}-{frame}-descriptors"][inside])
    return found


def median_error_px(
    cameras: tuple[CameraEntry, ...],
    features: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]],
    *,
    has_lens: bool,
) -> float:
    """Median distance of matched points from their epipolar lines, in pixels of the undistorted pictures."""
    errors: list[float] = []
    for a, b in combinations(range(len(cameras)), 2):
        relative = cameras[b].world_to_camera @ np.linalg.inv(cameras[a].world_to_camera)
        x, y, z = relative[:3, 3]
        essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ relative[:3, :3]
        focal = (cameras[a].K[0, 0] + cameras[b].K[0, 0]) / 2
        for frame in FRAMES:
            (one, other) = (features[row, frame] for row in (a, b))
            rows, columns = mutual_matches(one[1], other[1])
            if not len(rows):
                continue
            points_a = rays(cameras[a], one[0][rows], has_lens=has_lens)
            points_b = rays(cameras[b], other[0][columns], has_lens=has_lens)
            lines_b, lines_a = points_a @ essential.T, points_b @ essential
            off = np.abs((points_b * lines_b).sum(1))
            both = off / np.hypot(*lines_b[:, :2].T) + off / np.hypot(*lines_a[:, :2].T)
            errors += (focal * both / 2).tolist()
    matched = np.array(errors)
    assert (matched < MATCHED_PX).sum() > 300
    return float(np.median(matched[matched < MATCHED_PX]))


def rays(camera: CameraEntry, xy: np.ndarray, *, has_lens: bool) -> np.ndarray:
    """Points of a stored picture as rays x/z, y/z, 1. [N, 3]"""
    plain = (xy - camera.K[:2, 2]) / np.diag(camera.K)[:2]
    bent = camera.lens.undistort(plain) if has_lens else plain
    return np.column_stack([bent, np.ones(len(bent))])


def mutual_matches(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of unit descriptors that are each other's nearest by far."""
    if min(len(one), len(other)) < 2:
        return np.zeros(0, int), np.zeros(0, int)
    alike = one @ other.T
    best = alike.argmax(1)
    second = np.partition(alike, -2, axis=1)[:, -2]
    angles = np.arccos(np.clip(np.stack([alike[np.arange(len(one)), best], second]), -1, 1))
    is_good = (alike.argmax(0)[best] == np.arange(len(one))) & (angles[0] < RATIO * angles[1])
    return np.flatnonzero(is_good), best[is_good]
