"""First estimates of cameras that only see what their neighbours see: pair joined to pair, all around a ring.

Mapping one camera after the other needs points that three cameras see, which are few where neighbours are 30 to 45
degrees apart. Here each pair gives turn and direction; how far apart a pair is follows from how far away that is what
it and the next pair see, also where that is not the same point but one next to it at the same moment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import cv2
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from engine.calibration.matching.matching import KeyPoints, Pair, homogeneous
from engine.calibration.matching.motions import AgreedMotion, on_planes
from engine.calibration.solving.agreement import MatchAgreement
from engine.calibration.solving.cameras import Cameras
from engine.calibration.solving.mapping import FirstEstimate
from engine.calibration.solving.tracks import Tracks

CLOSES_DEG = 30.0
"""Within which a pair has to agree with the chain of others between its cameras, in which errors add up."""
NEAR_PX = 8.0
"""At a width of 640: key points that near each other, at one moment, are about as far away."""
MIN_NEAR = 8
MAX_GAP_DEG = 90.0
MIN_IN_CHAIN = 100
"""Matches of a pair that counts in a closed chain. Right neighbours 36 degrees apart have 180 and more; cameras 72
degrees apart, whose 64 matches closed a ring that was off by 7 %, have fewer."""
MIN_IN_THREE = 8
"""Points that three cameras see, for two pairs to hold each other's sizes."""
REACH_PX = 4.0
"""At a width of 640, of matches from a motion."""


@dataclass(frozen=True, slots=True)
class PairGeometry:
    """From the first camera of a pair to the second, as far apart as 1.

    Attributes:
        rotation, direction: [3, 3], [3]
        rows: Matches that lie before both cameras. [M, 2]
        depths: Of these in both. [M, 2]
    """

    rotation: np.ndarray
    direction: np.ndarray
    rows: np.ndarray
    depths: np.ndarray


def linked_pairs(
    motions: Mapping[Pair, AgreedMotion], key_points: list[KeyPoints], sizes: np.ndarray, focal: float
) -> tuple[dict[Pair, PairGeometry], list[Pair]]:
    """Pairs that do not contradict each other, with their geometry, and those of them that join all cameras.

    The pairs of greatest worth join cameras first; others count if they agree with the chain between their cameras.
    """
    n = len(key_points)
    geometries: dict[Pair, PairGeometry] = {}
    for pair in sorted(motions, key=lambda one: -motions[one].worth):
        geometry = _geometry(pair, motions[pair].rows, key_points, sizes, focal)
        if geometry is not None:
            geometries[pair] = geometry
    group, turns, tree = np.arange(n), np.tile(np.eye(3), (n, 1, 1)), []
    for (a, b), geometry in geometries.items():
        if group[a] != group[b]:
            is_joined = group == group[b]
            turns[is_joined] = turns[is_joined] @ (turns[b].T @ geometry.rotation @ turns[a])
            group[is_joined] = group[a]
            tree.append((a, b))
    agreeing = {
        (a, b): geometry
        for (a, b), geometry in geometries.items()
        if group[a] == group[b] and _angle_deg(turns[b] @ turns[a].T @ geometry.rotation.T) < CLOSES_DEG
    }
    return agreeing, tree


def linked_estimate(
    geometries: Mapping[Pair, PairGeometry],
    tree: Sequence[Pair],
    key_points: list[KeyPoints],
    sizes: np.ndarray,
    focal: float,
) -> FirstEstimate | None:
    """Cameras from pairs that join them; None where they join fewer than three.

    Args:
        geometries, tree: Of `linked_pairs`.
        key_points, sizes: Of all cameras.
        focal: Per longer side of the picture.
    """
    lengths = _lengths(geometries, tree, key_points, sizes)
    if len(lengths) < 2:
        return None
    start = next(iter(lengths))[0]
    poses = {start: (np.eye(3), np.zeros(3))}
    while more := [pair for pair in lengths if (pair[0] in poses) != (pair[1] in poses)]:
        for a, b in more:
            turn, step = geometries[a, b].rotation, geometries[a, b].direction * lengths[a, b]
            if a in poses and b not in poses:
                poses[b] = turn @ poses[a][0], turn @ poses[a][1] + step
            elif b in poses and a not in poses:
                poses[a] = turn.T @ poses[b][0], turn.T @ (poses[b][1] - step)
    rows = np.array(sorted(poses))
    cameras = Cameras(
        "simple",
        np.array([poses[row][0] for row in rows]),
        np.array([poses[row][1] for row in rows]),
        focal * sizes[rows].max(1).astype(np.float64),
        np.ones(len(rows)),
        sizes[rows] / 2.0,
        np.zeros((len(rows), 1)),
    )
    return FirstEstimate(rows, cameras, are_alike=True)


def is_held(agreed: MatchAgreement, tracks: Tracks) -> np.ndarray:
    """Which cameras a closed chain of firm pairs holds that is of one size. [R]

    Pairs say nothing about how far apart cameras are, and an open chain can turn at every link: only what closes, and
    is of one size, is right. Points that three cameras see tie the sizes of two pairs; parts of a chain that have two
    cameras in common, as the two halves of a ring have, get one size from these, and five more equations have to hold.
    A single pair that nothing else ties closes no ring: it can be off without being noticed.
    """
    firm = agreed.is_firm & (agreed.n_matches >= MIN_IN_CHAIN)
    pairs = [(int(a), int(b)) for a, b in np.argwhere(np.triu(firm))]
    held = np.zeros(len(firm), dtype=bool)
    if not pairs:
        return held
    largest = max(_of_one_size(pairs, tracks, len(firm)), key=lambda part: len({*chain.from_iterable(part)}))
    closed = []
    for pair in largest:  # a pair is part of a closed chain if its cameras hang together without it
        labels = _groups([other for other in largest if other != pair], len(firm))
        if labels[pair[0]] == labels[pair[1]]:
            closed.append(pair)
    if not closed:
        return held
    labels = _groups(closed, len(firm))  # two closed chains that one pair joins can turn against each other
    return labels == np.bincount(labels).argmax()


def surrounds(rotations: np.ndarray) -> bool:
    """Whether cameras look at a place from all around, so that the turns between them add up to a whole one.

    Only then do the pairs say how long focal lengths are. Cameras on one side hold together with wrong ones, too.
    """
    axes = rotations[:, 2]
    plane = np.linalg.svd(axes, full_matrices=False)[2][:2]
    angles = np.sort(np.degrees(np.arctan2(*(axes @ plane.T).T)))
    return float(np.diff(angles, append=angles[0] + 360).max()) < MAX_GAP_DEG


def _groups(pairs: Sequence[Pair], n: int) -> np.ndarray:
    """A number for each of n cameras, the same for those that pairs join."""
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return connected_components(csr_matrix((np.ones(len(ends)), ends.T), shape=(n, n)), directed=False)[1]


def _of_one_size(pairs: Sequence[Pair], tracks: Tracks, n_cameras: int) -> list[list[Pair]]:
    """Pairs in parts whose sizes relative to each other are known."""
    sees = np.zeros((n_cameras, len(tracks.points)), dtype=np.int64)
    sees[tracks.seen.cameras, tracks.seen.points] = 1
    parts = [[pair] for pair in pairs]

    def are_tied(first: Sequence[Pair], second: Sequence[Pair]) -> bool:
        members = [{*chain.from_iterable(part)} for part in (first, second)]
        if len(members[0] & members[1]) >= 2 and min(map(len, members)) >= 3:
            return True
        threes = ({*one, *other} for one in first for other in second)
        return any(len(three) == 3 and sees[sorted(three)].all(0).sum() >= MIN_IN_THREE for three in threes)

    while tied := next(((a, b) for a, b in combinations(parts, 2) if are_tied(a, b)), None):
        parts = [part for part in parts if part not in tied] + [tied[0] + tied[1]]
    return parts


def _geometry(
    pair: Pair, rows: np.ndarray, key_points: list[KeyPoints], sizes: np.ndarray, focal: float
) -> PairGeometry | None:
    first, second = on_planes(pair, rows, key_points, sizes, focal)
    essential, fits = cv2.findEssentialMat(
        first, second, np.eye(3), method=cv2.USAC_MAGSAC, prob=0.9999, threshold=REACH_PX / 640 / focal
    )
    if essential is None or essential.shape != (3, 3):
        return None
    _, rotation, direction, is_before = cv2.recoverPose(essential, first, second, np.eye(3), mask=fits)
    direction = direction.reshape(3)
    rays = np.stack([homogeneous(first) @ rotation.T, -homogeneous(second)], axis=-1)
    squares = np.einsum("nki,nkj->nij", rays, rays) + 1e-12 * np.eye(2)
    depths = np.linalg.solve(squares, -np.einsum("nki,k->ni", rays, direction)[..., None])[..., 0]
    kept = (is_before.reshape(-1) > 0) & (depths > 0).all(1)
    return PairGeometry(rotation, direction, rows[kept], depths[kept]) if kept.sum() >= MIN_NEAR else None


def _lengths(
    geometries: Mapping[Pair, PairGeometry], tree: Sequence[Pair], key_points: list[KeyPoints], sizes: np.ndarray
) -> dict[Pair, float]:
    """How far the cameras of each pair are apart, the first pair 1; without pairs that nothing ties to the others."""
    left = [pair for pair in tree if pair in geometries]
    lengths = {left.pop(0): 1.0} if left else {}
    while left:
        best: tuple[float, Pair, float] | None = None
        for pair in left:
            for known, length in lengths.items():
                common = {*pair} & {*known}
                if not common:
                    continue
                camera = common.pop()
                ratios = _ratios(camera, geometries, known, pair, key_points, sizes)
                if len(ratios) < MIN_NEAR:
                    continue
                middle = float(np.median(ratios))
                certainty = len(ratios) / (0.05 + float(np.median(np.abs(ratios - middle))))
                if best is None or certainty > best[0]:
                    best = certainty, pair, length * float(np.exp(middle))
        if best is None:
            break
        lengths[best[1]] = best[2]
        left.remove(best[1])
    return lengths


def _ratios(
    camera: int, geometries, known: Pair, pair: Pair, key_points: list[KeyPoints], sizes: np.ndarray
) -> np.ndarray:
    """Logarithms of depths in one pair divided by those in another, of what both see in the camera they share. [N]"""
    places, depths = [], []
    for one in (known, pair):
        end = one.index(camera)
        rows = geometries[one].rows[:, end]
        moments = key_points[camera].moments[rows, None] * 1e6
        places.append(np.concatenate([key_points[camera].pixels[rows], moments], axis=1))
        depths.append(geometries[one].depths[:, end])
    reach_px = NEAR_PX * float(sizes[camera].max()) / 640
    off, found = KDTree(places[0]).query(places[1], distance_upper_bound=reach_px)
    is_near, nearest = np.isfinite(off), np.asarray(found)
    return np.log(depths[0][nearest[is_near]] / depths[1][is_near])


def _angle_deg(rotation: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))))
