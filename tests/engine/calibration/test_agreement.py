"""A camera that stands elsewhere is found out by matches, however well the rest fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.calibration.matching.matching import KeyPoints, Pair, all_pairs
from engine.calibration.solving.agreement import MatchAgreement, agreement
from engine.calibration.solving.cameras import Cameras, rotation_of
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


def test_right_cameras_explain_their_matches_and_hold_together() -> None:
    found = judged(*matched())
    assert found.shares.min() > 0.95
    assert found.is_plausible.all()
    assert found.is_placed.all()


def test_a_misplaced_camera_does_not_hold_together_with_the_others() -> None:
    cameras, key_points, matches = matched()
    rotations = cameras.rotations.copy()
    rotations[4] = rotation_of(np.array([[0.0, 0.3, 0.1]]))[0] @ rotations[4]
    found = judged(replace(cameras, rotations=rotations), key_points, matches)
    assert np.flatnonzero(~found.is_placed).tolist() == [4]
    assert not found.is_plausible[4]
    assert found.shares[4] < 0.3


def test_matches_of_a_repeating_pattern_do_not_make_right_cameras_doubtful() -> None:
    cameras, key_points, matches = matched()
    generator = np.random.default_rng(0)
    pair = (0, 11)
    n = min(len(matches[0, 1]), len(matches[10, 11])) * 3 // 4
    wrong = np.stack([generator.integers(0, len(key_points[row]), n) for row in pair], axis=-1)
    found = judged(cameras, key_points, matches | {pair: wrong})
    assert found.is_placed.all()
    assert found.shares[0] < 0.95


def counted(*pairs: tuple[int, int, int, int], n_cameras: int) -> MatchAgreement:
    """Of pairs of cameras with matches and how many of them are explained."""
    n_matches, n_explained = np.zeros((2, n_cameras, n_cameras), dtype=np.int64)
    for a, b, n, explained in pairs:
        n_matches[a, b] = n_matches[b, a] = n
        n_explained[a, b] = n_explained[b, a] = explained
    return MatchAgreement(n_matches, n_explained)


def test_an_end_that_fits_a_room_alike_from_several_sides_is_found_out_and_its_neighbour_is_not() -> None:
    """As cameras 7 to 11 of twelve neighbours of the sample: 11 stands opposite, and is the strongest witness of 10."""
    found = counted(
        (0, 1, 252, 252), (1, 2, 121, 121), (0, 2, 84, 84), (1, 3, 58, 58), (2, 3, 96, 96), (2, 4, 95, 95),
        (3, 4, 115, 115), (4, 5, 187, 29), (0, 5, 165, 149), (1, 5, 117, 83), (2, 5, 102, 87), n_cameras=6,
    )  # fmt: skip
    assert np.flatnonzero(~found.is_placed).tolist() == [5]


def test_a_chain_of_pairs_holds_nothing_together() -> None:
    """As every second camera of the sample: neighbours agree, but no three do, and places are off by a fifth."""
    chain = [(row, row + 1, 180, 180) for row in range(4)]
    assert not counted(*chain, n_cameras=5).is_placed.any()
    found = counted(*chain, (0, 2, 60, 60), n_cameras=5)
    assert np.flatnonzero(found.is_placed).tolist() == [0, 1, 2]


def test_two_firm_partners_of_a_group_hold_a_camera() -> None:
    """As camera 16 of the sample: its two neighbours share a pattern that repeats, so not all three agree."""
    found = counted((0, 1, 90, 90), (1, 2, 90, 90), (0, 2, 90, 90), (0, 3, 253, 253), (2, 3, 218, 215), n_cameras=4)
    assert found.is_placed.all()
    few = counted((0, 1, 90, 90), (1, 2, 90, 90), (0, 2, 90, 90), (0, 3, 253, 253), (2, 3, 20, 20), n_cameras=4)
    assert np.flatnonzero(~few.is_placed).tolist() == [3]
