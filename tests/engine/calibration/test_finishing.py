"""What is doubtful about a calibration is said, camera by camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.calibration.agreement import Agreement
from engine.calibration.finishing import _doubts
from engine.calibration.solving import Solution
from engine.calibration.tracks import Tracks
from tests.engine.calibration.made_rigs import SIZE, make_seen


def test_each_camera_that_something_speaks_against_has_a_reason() -> None:
    cameras = make_seen("forward", "simple").truth
    focals = cameras.focals.copy()
    focals[4] *= 1.5
    n = len(cameras)
    solution = Solution(np.arange(n), replace(cameras, focals=focals), Tracks.none(), True)
    most_for, most_against, neighbours = np.full(n, 200), np.zeros(n, np.int64), np.full(n, 5)
    most_against[1], neighbours[2] = 300, 1
    sightings = np.full(n, 400)
    sightings[3] = 20
    agreed = Agreement(np.full(n, 900), np.full(n, 850), most_for, most_against, neighbours)
    doubts = _doubts(solution, sightings, agreed, np.tile(SIZE, (n, 1)))
    assert "300 matches with one camera speak against its place" in doubts[1]
    assert "1 cameras agree" not in doubts[2]
    assert "one camera agrees" in doubts[2]
    assert doubts[3] == "only 20 points"
    assert "focal length" in doubts[4]
    assert [i for i, doubt in enumerate(doubts) if doubt] == [1, 2, 3, 4]
