"""How far cameras agree with the matches that were found before there were any cameras.

A small error of sightings says nothing about misplaced cameras, since matches that do not fit are left out of it. Two
cameras that see the same have matches that fit one motion. Right cameras explain all of these, but for patterns that
repeat; cameras that stand elsewhere explain hardly any, or, in a room that looks alike from several sides, four fifths:
so what counts is whom a camera explains all matches with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from engine.calibration.matching.matching import KeyPoints, Pair
from engine.calibration.solving.cameras import Cameras
from engine.calibration.solving.tracks import fitting_matches

REACH_PX = 6.0
"""At a width of 640, from the epipolar line."""
MIN_MATCHES = 15
"""Of two cameras; fewer fit one motion by chance."""
AGREES = 0.8
"""Share of a pair's matches that is explained where both cameras may be right."""
CONTRADICTS = 0.4
"""Share at most of a pair's matches that is explained where a camera is misplaced, or a pattern repeats."""
MIN_AGREEING = 2
"""Other cameras that have to agree: one neighbour may be misplaced together with it."""
FIRM, MIN_FIRM_MATCHES = 0.97, 30
"""Share, and matches, from which on a pair holds together: right neighbours explain 99 to 100 %, while at most 95 % are
explained by chance where a room looks alike from several sides."""


@dataclass(frozen=True, slots=True)
class MatchAgreement:
    """Of cameras with the verified matches they have with each other.

    Attributes:
        n_matches: Of every two cameras. [C, C]
        n_explained: Those the cameras explain. [C, C]
        held: Cameras that hold together by another rule, see engine.calibration.solving.links; None for that of
            `is_placed`. [C]
    """

    n_matches: np.ndarray
    n_explained: np.ndarray
    held: np.ndarray | None = None

    @property
    def shares(self) -> np.ndarray:
        """Of each camera's matches, those that are explained. [C]"""
        return self.n_explained.sum(1) / np.maximum(self.n_matches.sum(1), 1)

    @property
    def is_plausible(self) -> np.ndarray:
        """Whether two others agree with each camera, among them its strongest witness. For rough estimates. [C]"""
        agrees = (self.n_matches > 0) & (self.n_explained >= AGREES * self.n_matches)
        contradicts = self.n_explained <= CONTRADICTS * self.n_matches
        most_for, most_against = ((self.n_matches * chosen).max(1) for chosen in (agrees, contradicts))
        return (most_for >= most_against) & (agrees.sum(1) >= MIN_AGREEING)

    @property
    def is_firm(self) -> np.ndarray:
        """Whether two cameras explain all of their matches, as good as. [C, C]"""
        return (self.n_matches >= MIN_FIRM_MATCHES) & (self.n_explained >= FIRM * self.n_matches)

    @property
    def is_placed(self) -> np.ndarray:
        """Which cameras hold together: the largest group of firm pairs, three by three, and who has two firm partners
        in it. [C]

        In a chain of pairs each can be as far from the next as it likes; three cameras that all agree cannot.
        """
        if self.held is not None:
            return self.held
        firm = self.is_firm.astype(np.int64)
        links = (firm > 0) & (firm @ firm > 0)
        _, groups = connected_components(links, directed=False)
        sizes = np.bincount(groups[links.any(1)], minlength=len(firm) + 1)
        is_placed, n_placed = groups == sizes.argmax(), 0
        is_placed &= links.any(1)
        while is_placed.sum() > n_placed:
            n_placed = is_placed.sum()
            is_placed |= firm[:, is_placed].sum(1) >= MIN_AGREEING
        return is_placed


def agreement(
    rows: np.ndarray, cameras: Cameras, key_points: list[KeyPoints], verified: dict[Pair, np.ndarray], width: float
) -> MatchAgreement:
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
    n_matches, n_explained = np.zeros((2, len(rows), len(rows)), dtype=np.int64)
    for (a, b), found in matches.items():
        n_matches[a, b] = n_matches[b, a] = len(found)
        n_explained[a, b] = n_explained[b, a] = len(fitting[a, b])
    return MatchAgreement(n_matches, n_explained)
