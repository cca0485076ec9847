"""A camera that stands elsewhere is found out by matches, however well the rest fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.calibration.agreement import agreement
from engine.calibration.cameras import Cameras, rotation_of
from engine.calibration.matching import KeyPoints, Pair, all_pairs
from tests.engine.calibration.made_rigs import SIZE, make_seen

N_CAMERAS = 12


def matched() -> tuple[Cameras, list[KeyPoints], dict[Pair, np.ndarray]]:
    """Cameras of a generated rig, what they see, and all right matches."""
    seen = make_seen("forward", "simple")
    key_points, rows_of = [], []
    for camera in range(N_CAMERAS):
        rows = np.flatnonzero(seen.sightings.cameras == camera)
        n = len(rows)
        key_points.append(KeyPoints(seen.sightings.pixels[rows], np.zeros(n, np.int64), np.zeros((n, 128), np.float32)))
        rows_of.append({int(point): i for i, point in enumerate(seen.sightings.points[rows])})
    matches = {
        (a, b): np.array([(rows_of[a][p], rows_of[b][p]) for p in rows_of[a] if p in rows_of[b]]).reshape(-1, 2)
        for a, b in all_pairs(N_CAMERAS)
    }
    return seen.truth, key_points, matches


def judged(cameras: Cameras, key_points: list[KeyPoints], matches: dict[Pair, np.ndarray]):
    return agreement(np.arange(N_CAMERAS), cameras, key_points, matches, float(SIZE[0]))


def test_right_cameras_explain_their_matches_and_nobody_is_doubtful() -> None:
    found = judged(*matched())
    assert found.shares.min() > 0.95
    assert not found.is_doubtful.any()


def test_a_misplaced_camera_is_doubtful_and_the_others_are_not() -> None:
    cameras, key_points, matches = matched()
    rotations = cameras.rotations.copy()
    rotations[4] = rotation_of(np.array([[0.0, 0.3, 0.1]]))[0] @ rotations[4]
    found = judged(replace(cameras, rotations=rotations), key_points, matches)
    assert np.flatnonzero(found.is_doubtful).tolist() == [4]
    assert found.shares[4] < 0.3


def test_matches_of_a_repeating_pattern_do_not_make_right_cameras_doubtful() -> None:
    cameras, key_points, matches = matched()
    generator = np.random.default_rng(0)
    pair = (0, 11)
    n = min(len(matches[0, 1]), len(matches[10, 11])) * 3 // 4
    wrong = np.stack([generator.integers(0, len(key_points[row]), n) for row in pair], axis=-1)
    found = judged(cameras, key_points, matches | {pair: wrong})
    assert not found.is_doubtful.any()
    assert found.shares[0] < 0.95


def test_a_camera_that_only_one_other_agrees_with_is_doubtful() -> None:
    cameras, key_points, matches = matched()
    few = {pair: rows if 3 not in pair or pair == (3, 4) else rows[:5] for pair, rows in matches.items()}
    found = judged(cameras, key_points, few)
    assert np.flatnonzero(found.is_doubtful).tolist() == [3]
    assert found.n_neighbours[3] == 1
