"""From comparisons of pairs of cameras to one offset per camera: pairs err, loops of pairs show which ones.

First whole frames: the offsets under which the curves of all pairs are highest together. Then parts of a frame: the
top of each curve nearby is a measurement, and a robust fit over all of them gives offsets and their uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.synchronisation.correlating import PairCurve
from engine.synchronisation.synchronisation import PairOffset

MIN_SCORE = 0.25
"""Correlation below which a pair says nothing."""
MIN_PROMINENCE = 0.04
"""How much higher the best offset of a pair must be than the next best, elsewhere."""
ELSEWHERE_FRAMES = 2.5
NEAR_FRAMES = 1.6
"""Tops of curves this near to the common answer are measurements; others are errors of their pair."""
CLOSE_SECOND = 0.8
"""A top near the common answer counts as what a pair says if it is as high as this share of its highest."""
MAX_SWEEPS = 30
OUTLIER_SIGMAS = 2.5
MIN_SIGMA_FRAMES = 0.02
AGREE_FRAMES = 0.75
"""A pair agrees with the offsets of its cameras up to this much."""


@dataclass(frozen=True, eq=False)
class OffsetSolution:
    """One offset per camera.

    Attributes:
        offsets_frames: NaN where no pair says anything. [C]
        sigmas_frames: Standard deviations, likewise. [C]
        groups: Number of the connected set of cameras, -1 for none. [C] int64
        pairs: The measurement of each pair that says something.
        agreements: Share of the pairs of each camera that agree, NaN without pairs. [C]
    """

    offsets_frames: np.ndarray
    sigmas_frames: np.ndarray
    groups: np.ndarray
    pairs: tuple[PairOffset, ...]
    agreements: np.ndarray


def solve_curves(n_cameras: int, curves: Sequence[PairCurve]) -> OffsetSolution:
    """Offsets of all cameras from the curves of pairs."""
    telling = [curve for curve in curves if _prominence(curve) >= MIN_PROMINENCE and curve.scores.max() >= MIN_SCORE]
    telling.sort(key=_prominence, reverse=True)
    groups = _groups(n_cameras, [(curve.first, curve.second) for curve in telling])
    whole = _climb(n_cameras, telling, groups)
    pairs = [
        pair for curve in telling if (pair := _top_near(curve, whole[curve.second] - whole[curve.first])) is not None
    ]
    return solve_pairs(n_cameras, pairs)


def solve_pairs(n_cameras: int, pairs: Sequence[PairOffset]) -> OffsetSolution:
    """Offsets of all cameras from one measurement per pair, of which some are wrong."""
    groups = _groups(n_cameras, [(pair.first, pair.second) for pair in pairs])
    offsets, sigmas = np.full((2, n_cameras), np.nan)
    agreements = np.full(n_cameras, np.nan)
    for group in range(groups.max(initial=-1) + 1):
        members = np.flatnonzero(groups == group)
        inside = [pair for pair in pairs if groups[pair.first] == group]
        offsets[members], sigmas[members] = _fit(members, inside)
    weights, agreeing = np.zeros((2, n_cameras))
    for pair in pairs:
        error = abs(offsets[pair.second] - offsets[pair.first] - pair.offset_frames)
        weight = 1 / max(pair.sigma_frames, MIN_SIGMA_FRAMES)
        for camera in (pair.first, pair.second):
            weights[camera] += weight
            agreeing[camera] += weight * (error <= max(AGREE_FRAMES, OUTLIER_SIGMAS * pair.sigma_frames))
    has_pairs = weights > 0
    agreements[has_pairs] = agreeing[has_pairs] / weights[has_pairs]
    return OffsetSolution(offsets, sigmas, groups, tuple(pairs), agreements)


def common_zero(offsets_frames: np.ndarray) -> float:
    """The offset that most cameras share, to which all others are relative. NaN entries do not count."""
    known = offsets_frames[np.isfinite(offsets_frames)]
    if len(known) == 0:
        return 0.0
    n_near = (np.abs(known[:, None] - known) <= 0.3).sum(axis=1)
    best = known[n_near == n_near.max()]
    center = best[np.argmin(np.abs(best - np.median(known)))]
    return float(np.median(known[np.abs(known - center) <= 0.3]))


def _prominence(curve: PairCurve) -> float:
    """By how much the best offset of a pair is better than any other top."""
    if len(curve.scores) < 3:
        return 0.0
    best = int(np.argmax(curve.scores))
    is_top = np.r_[False, (curve.scores[1:-1] >= curve.scores[:-2]) & (curve.scores[1:-1] >= curve.scores[2:]), False]
    is_elsewhere = np.abs(curve.offsets_frames - curve.offsets_frames[best]) > ELSEWHERE_FRAMES
    others = curve.scores[is_top & is_elsewhere]
    lowest = float(np.median(curve.scores))
    return float(curve.scores[best]) - max(float(others.max(initial=-1.0)), lowest)


def _groups(n_cameras: int, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Number of the connected set of each camera; -1 for cameras without pairs. [C] int64"""
    groups = np.full(n_cameras, -1, dtype=np.int64)
    neighbours: dict[int, list[int]] = {}
    for first, second in pairs:
        neighbours.setdefault(first, []).append(second)
        neighbours.setdefault(second, []).append(first)
    n_groups = 0
    for camera in sorted(neighbours):
        waiting = [camera] if groups[camera] < 0 else []
        while waiting:
            member = waiting.pop()
            if groups[member] < 0:
                groups[member] = n_groups
                waiting += neighbours[member]
        n_groups = int(groups.max()) + 1
    return groups


def _climb(n_cameras: int, curves: list[PairCurve], groups: np.ndarray) -> np.ndarray:
    """Whole offsets under which all curves together are high: from the clearest pairs, then camera by camera. [C]"""
    offsets = np.zeros(n_cameras)
    tree = list(range(n_cameras))  # root of each camera's part of the spanning tree
    for curve in curves:  # clearest first
        one, other = tree[curve.first], tree[curve.second]
        if one != other:
            best = curve.offsets_frames[int(np.argmax(curve.scores))]
            moved = [camera for camera in range(n_cameras) if tree[camera] == other]
            offsets[moved] += offsets[curve.first] + best - offsets[curve.second]
            for camera in moved:
                tree[camera] = one
    for _ in range(MAX_SWEEPS):
        has_changed = False
        for camera in np.flatnonzero(groups >= 0):
            mine = [curve for curve in curves if camera in (curve.first, curve.second)]
            reach = max(float(np.abs(curve.offsets_frames).max()) for curve in mine)
            candidates = offsets[camera] + np.arange(-2 * reach, 2 * reach + 1)
            total = np.zeros(len(candidates))
            for curve in mine:
                is_second = curve.second == camera
                relative = candidates - offsets[curve.first] if is_second else offsets[curve.second] - candidates
                evidence = np.arctanh(np.clip(curve.scores, 0, 0.98)) ** 2 * curve.overlaps
                total += np.interp(relative, curve.offsets_frames, evidence, left=0, right=0)
            best = candidates[int(np.argmax(total))]
            if total.max() > total[len(total) // 2] + 1e-9:
                offsets[camera], has_changed = best, True
        if not has_changed:
            break
    return offsets


def _top_near(curve: PairCurve, expected: float) -> PairOffset | None:
    """A pair's offset: the top of its curve near the expected offset if that is about the highest; else the highest,
    which is then an error of this pair."""
    near = np.flatnonzero(np.abs(curve.offsets_frames - expected) <= NEAR_FRAMES)
    inner = near[(near > 0) & (near < len(curve.scores) - 1)]
    is_top = [curve.scores[row] >= max(curve.scores[row - 1], curve.scores[row + 1]) for row in inner]
    tops = inner[np.array(is_top, dtype=bool)]
    row = int(np.argmax(curve.scores))
    if len(tops) and curve.scores[tops].max() >= CLOSE_SECOND * curve.scores[row]:
        row = int(tops[np.argmax(curve.scores[tops])])
    if not 0 < row < len(curve.scores) - 1 or curve.scores[row] < MIN_SCORE / 2:
        return None
    before, top, after = np.arctanh(np.clip(curve.scores[row - 1 : row + 2], -0.98, 0.98))
    bend = before - 2 * top + after
    shift = 0.5 * (before - after) / bend if bend < -1e-9 else 0.0
    score = float(min(curve.scores[row], 0.98))
    width = float(np.sqrt(top / max(-bend, 1e-3)))
    sigma = max(0.25 * width * float(np.sqrt(1 - score**2)) / score, MIN_SIGMA_FRAMES)
    return PairOffset(curve.first, curve.second, float(curve.offsets_frames[row] + np.clip(shift, -0.5, 0.5)), sigma)


def _fit(members: np.ndarray, pairs: list[PairOffset]) -> tuple[np.ndarray, np.ndarray]:
    """Offsets and uncertainties of the cameras of one group; pairs that the others contradict lose their weight."""
    number = {int(camera): row for row, camera in enumerate(members)}
    n = len(members)
    rows = np.arange(len(pairs))
    system = np.zeros((len(pairs), n))
    system[rows, [number[pair.first] for pair in pairs]] = -1
    system[rows, [number[pair.second] for pair in pairs]] = 1
    measured = np.array([pair.offset_frames for pair in pairs])
    own = np.array([max(pair.sigma_frames, MIN_SIGMA_FRAMES) for pair in pairs])
    weights = 1 / own
    offsets = np.zeros(n)
    for round_index in range(60):
        offsets = _weighted(system, measured, weights)
        errors = measured - system @ offsets
        scale = _scale(errors / own, len(pairs) - n + 1)
        if round_index < 20:  # sums of distances first: they find the answer of the majority
            weights = 1 / own / np.maximum(np.abs(errors), 0.02)
        else:
            weights = 1 / own**2 / (1 + (errors / (OUTLIER_SIGMAS * own * scale)) ** 2) ** 2
    errors = measured - system @ offsets
    scale = _scale(errors / own, len(pairs) - n + 1)
    spread = 1 / own**2 / (1 + (errors / (OUTLIER_SIGMAS * own * scale)) ** 2) ** 2
    normal = (system.T * spread) @ system + 1e-9 * np.eye(n)
    variance = np.linalg.pinv(normal, rcond=1e-6)  # of offsets against the mean of the group
    return offsets, scale * np.sqrt(np.maximum(np.diag(variance), 0))


def _weighted(system: np.ndarray, measured: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted least squares with the mean offset at 0."""
    n = system.shape[1]
    normal = (system.T * weights) @ system + np.ones((n, n)) * weights.mean()
    return np.linalg.solve(normal + 1e-12 * np.eye(n) * weights.mean(), (system.T * weights) @ measured)


def _scale(errors: np.ndarray, n_spare: int) -> float:
    """By how much errors are larger than the pairs' own uncertainty; 1 where loops are too few."""
    if n_spare < 2:
        return 1.0
    usual = 1.4826 * float(np.median(np.abs(errors))) * np.sqrt(len(errors) / n_spare)
    return max(usual, 0.3)
