"""What is doubtful about a calibration is said, camera by camera, and whether it has failed."""

from __future__ import annotations

import numpy as np

from engine.calibration.finishing import _doubts, _failure
from engine.calibration.solving.agreement import MatchAgreement

NAMES = [f"cam{row}" for row in range(8)]


def made_up(firm: list[tuple[int, int]], weak: list[tuple[int, int]]) -> MatchAgreement:
    """Pairs that explain all of 200 matches, and pairs that explain 150 of 200."""
    n_matches, n_explained = np.zeros((2, len(NAMES), len(NAMES)), dtype=np.int64)
    for pairs, n in ((firm, 200), (weak, 150)):
        for a, b in pairs:
            n_matches[a, b] = n_matches[b, a] = 200
            n_explained[a, b] = n_explained[b, a] = n
    return MatchAgreement(n_matches, n_explained)


def test_each_camera_that_something_speaks_against_has_a_reason() -> None:
    ring = [(a, b) for a in range(6) for b in range(a)]
    agreed = made_up([*ring, (5, 6)], [(4, 7), (3, 7)])
    sightings = np.full(8, 400)
    sightings[3] = 20
    doubts = _doubts(NAMES, sightings, agreed, np.arange(8) == 1)
    assert [row for row, doubt in enumerate(doubts) if doubt] == [1, 3, 6, 7]
    assert "distorted" in doubts[1]
    assert doubts[3] == "only 20 points"
    assert doubts[6] == "one camera agrees with its position (cam5); 2 are needed"
    assert doubts[7] == "no camera agrees with its position; 150 of its 200 matches with cam3 are explained"
    assert _failure(agreed) == ""


def test_a_smaller_group_stands_apart_and_makes_it_fail() -> None:
    agreed = made_up([(0, 1), (1, 2), (0, 2), (2, 3), (1, 3), (3, 4), (2, 4), (5, 6), (6, 7), (5, 7)], [])
    doubts = _doubts(NAMES, np.full(8, 400), agreed, np.zeros(8, bool))
    assert doubts[5] == "those that agree with its position (cam6, cam7) do not agree with the others"
    assert [bool(doubt) for doubt in doubts] == [False] * 5 + [True] * 3
    assert _failure(agreed).startswith("Matches contradict the positions of 3 of 8 cameras")


def test_it_fails_where_too_few_of_a_large_rig_hold_together() -> None:
    agreed = made_up([(a, b) for a in range(8) for b in range(a)], [])
    assert _failure(agreed, 8) == ""
    assert _failure(agreed, 9) == "Only 8 cameras hold together, so none of them can be trusted."


def test_it_fails_where_nothing_holds_together() -> None:
    assert "8 of 8 cameras" in _failure(made_up([(0, 1), (2, 3)], []))
