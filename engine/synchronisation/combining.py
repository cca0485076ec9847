"""One offset per camera from what all sources say: the most certain word counts, others confirm or contradict it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from engine.synchronisation.solving import common_zero
from engine.synchronisation.synchronisation import (
    SURE_SIGMAS,
    CameraOffset,
    Disagreement,
    Estimate,
    SourceName,
    Synchronisation,
)

DISAGREE_FRAMES = 0.6
"""Sources differ where they are further apart than this, and than their uncertainty explains."""
ONE_PAIR_TRUST = 0.85
"""How far a camera is trusted that nothing but one pair speaks for."""


def combine(names: Sequence[str], estimates: Sequence[Estimate], fps: float) -> Synchronisation:
    """Put the answers of all sources together.

    Args:
        names: Of the cameras.
        estimates: Of every source. That of the time of creation is kept but not used.
        fps: Frames per second in which offsets are counted.
    """
    n_cameras = len(names)
    used = _aligned([estimate for estimate in estimates if estimate.source != "creation time"], n_cameras)
    offsets, sigmas = np.zeros(n_cameras), np.full(n_cameras, np.inf)
    chosen: list[Estimate | None] = [None] * n_cameras
    for estimate, aligned in used:
        is_better = np.isfinite(aligned) & (np.nan_to_num(estimate.sigmas_frames, nan=np.inf) < sigmas)
        offsets[is_better], sigmas[is_better] = aligned[is_better], estimate.sigmas_frames[is_better]
        for row in np.flatnonzero(is_better):
            chosen[row] = estimate
    known = np.isfinite(sigmas)
    offsets = np.where(known, offsets - common_zero(np.where(known, offsets, np.nan)), 0.0)
    disagreements: list[Disagreement] = []
    cameras = []
    for row, name in enumerate(names):
        source = chosen[row]
        if source is None:
            cameras.append(CameraOffset(name, 0.0, math.inf, 0.0, None))
            continue
        taken = next(aligned for estimate, aligned in used if estimate is source)[row]
        n_for, doubt, against = 0, 1.0, []
        for estimate, aligned in used:
            if estimate is source or not np.isfinite(aligned[row]):
                continue
            difference = float(aligned[row] - taken)
            apart = max(DISAGREE_FRAMES, SURE_SIGMAS * math.hypot(sigmas[row], estimate.sigmas_frames[row]))
            if abs(difference) <= apart:
                n_for += 1
            else:
                doubt *= 1 - 0.4 * min(1.0, float(sigmas[row] / estimate.sigmas_frames[row]))
                against.append(_disagreement(row, name, source.source, estimate, difference, offsets[row], fps))
        disagreements += against
        confidence = _confidence(source, row, float(sigmas[row]), n_for) * doubt
        cameras.append(CameraOffset(name, float(offsets[row]), float(sigmas[row]), confidence, source.source))
    return Synchronisation(tuple(cameras), tuple(estimates), tuple(disagreements), fps)


def _aligned(estimates: Sequence[Estimate], n_cameras: int) -> list[tuple[Estimate, np.ndarray]]:
    """Each estimate with its offsets against one zero; NaN where a group shares no camera with the others."""
    left = [estimate for estimate in estimates if estimate.n_known]
    left.sort(key=lambda estimate: (-_largest(estimate)[1], float(np.nanmedian(estimate.sigmas_frames))))
    base = np.full(n_cameras, np.nan)
    base_sigmas = np.full(n_cameras, np.inf)
    found = []
    for estimate in left:
        aligned = np.full(n_cameras, np.nan)
        for group in range(int(estimate.groups.max()) + 1):
            is_member = estimate.groups == group
            shared = is_member & np.isfinite(base)
            if shared.any():
                shift = _weighted_median(
                    (base - estimate.offsets_frames)[shared], 1 / np.hypot(base_sigmas, estimate.sigmas_frames)[shared]
                )
            elif not np.isfinite(base).any() and group == _largest(estimate)[0]:
                shift = -common_zero(np.where(is_member, estimate.offsets_frames, np.nan))
            else:
                continue
            aligned[is_member] = estimate.offsets_frames[is_member] + shift
        is_new = np.isfinite(aligned) & ~np.isfinite(base)
        base[is_new], base_sigmas[is_new] = aligned[is_new], estimate.sigmas_frames[is_new]
        found.append((estimate, aligned))
    return found


def _largest(estimate: Estimate) -> tuple[int, int]:
    """The group with most cameras, and how many they are."""
    counts = np.bincount(estimate.groups[estimate.groups >= 0])
    return int(np.argmax(counts)), int(counts.max())


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    heap = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(heap, heap[-1] / 2)])


def _disagreement(
    row: int, name: str, source: SourceName, other: Estimate, difference: float, offset: float, fps: float
) -> Disagreement:
    text = (
        f"{name}: {source} says {offset:+.2f} frames, {other.source} says {offset + difference:+.2f} "
        f"({abs(difference) / fps * 1000:.0f} ms apart)."
    )
    return Disagreement(row, source, other.source, difference, text)


def _confidence(estimate: Estimate, row: int, sigma: float, n_for: int) -> float:
    """How likely an offset is right to half a frame, 0..1."""
    confidence = math.erf(0.5 / (math.sqrt(2) * max(sigma, 1e-6)))
    agreement = estimate.agreements[row]
    if np.isfinite(agreement):
        n_pairs = sum(row in (pair.first, pair.second) for pair in estimate.pairs)
        confidence *= min(float(agreement) + 0.3, 1.0) if n_pairs > 1 else ONE_PAIR_TRUST
    for _ in range(n_for):
        confidence = 1 - (1 - confidence) * 0.5
    return confidence
