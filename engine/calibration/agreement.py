"""How far cameras agree with the matches that were found before there were any cameras.

A small error of sightings says nothing about misplaced cameras, since matches that do not fit are left out of it. Two
cameras that see the same have matches that fit one motion, and the cameras either explain nearly all of these or hardly
any: then the pattern repeats, or one of the two stands elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.calibration.cameras import Cameras
from engine.calibration.matching import KeyPoints, Pair
from engine.calibration.tracks import fitting_matches

REACH_PX = 6.0
"""At a width of 640, from the epipolar line."""
MIN_MATCHES = 15
"""Of two cameras; fewer fit one motion by chance."""
AGREES = 0.8
"""Share of a pair's matches that is explained where both cameras are right and the pattern does not repeat."""
CONTRADICTS = 0.4
"""Share at most of a pair's matches that is explained where a camera is misplaced, or a pattern repeats."""
MIN_AGREEING = 2
"""Other cameras that have to agree: one neighbour may be misplaced together with it."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Of each camera with the verified matches it has with others.

    Attributes:
        n_matches: Verified matches. [C]
        n_explained: Those the cameras explain. [C]
        n_agreeing: Matches with the camera that has most of those that agree with it. [C]
        n_contradicting: Matches with the camera that has most of those that contradict. [C]
        n_neighbours: Cameras that agree with it. [C]
    """

    n_matches: np.ndarray
    n_explained: np.ndarray
    n_agreeing: np.ndarray
    n_contradicting: np.ndarray
    n_neighbours: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Of each camera's matches, those that are explained. [C]"""
        return self.n_explained / np.maximum(self.n_matches, 1)

    @property
    def is_doubtful(self) -> np.ndarray:
        """Whether the strongest witness speaks against a camera's place, or too few speak for it. [C]

        Nearest neighbours have most matches, far more than patterns that repeat, so a camera that its strongest
        witness contradicts stands elsewhere.
        """
        return (self.n_agreeing < self.n_contradicting) | (self.n_neighbours < MIN_AGREEING)


def agreement(
    rows: np.ndarray, cameras: Cameras, key_points: list[KeyPoints], verified: dict[Pair, np.ndarray], width: float
) -> Agreement:
    """How far cameras explain verified matches.

    Args:
        rows: Which cameras, rising. [R]
        cameras: In this order.
        key_points, verified: Of all cameras.
        width: Of the pictures, px.
    """
    place = {int(row): i for i, row in enumerate(rows)}
    matches = {
        (place[a], place[b]): found
        for (a, b), found in verified.items()
        if a in place and b in place and len(found) >= MIN_MATCHES
    }
    fitting = fitting_matches(matches, [key_points[row] for row in rows], cameras, REACH_PX * width / 640)
    sums, most = np.zeros((3, len(rows)), dtype=np.int64), np.zeros((2, len(rows)), dtype=np.int64)
    for pair, found in matches.items():
        n, n_fitting = len(found), len(fitting[pair])
        agrees, contradicts = n_fitting >= AGREES * n, n_fitting <= CONTRADICTS * n
        for camera in pair:
            sums[:, camera] += (n, n_fitting, agrees)
            most[:, camera] = np.maximum(most[:, camera], (agrees * n, contradicts * n))
    return Agreement(sums[0], sums[1], most[0], most[1], sums[2])
