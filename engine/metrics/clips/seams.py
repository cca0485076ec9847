"""Cross-clip residual: what changes between neighbouring frames of a render that does not change in the truth.

For two neighbouring frames of one camera: R = mean over channels of |render - previous render|, G = the same of the
truth, E = max(R - G, 0). At a clip boundary E on static pixels is the visible seam; the same pairs inside the clips say
what is normal for this model. Differences are of display-encoded colours in 0..1; scores are in units of 1/255.
Source: ClipGStream shows R between adjacent clips without a formula; E, the split and the score are this project's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from engine.metrics.clips.summary import GROUPS, mean_of

STATIC_THRESHOLD = 3.0 / 255.0
"""The truth of a static pixel changes by less, after the blur: more than compression noise, less than any motion."""
BLUR_PX_PER_640 = 1.0
"""Sigma of the blur of G before the threshold, pixels at a picture width of 640: single noisy pixels do not move."""
MAP_RANGE = (0.0, 0.1)
"""Colour range of the maps of R, G and E: one for all frames, so that the colours themselves do not flicker."""


@dataclass(frozen=True, slots=True)
class SeamMaps:
    """Two neighbouring frames of one camera, per pixel. Show the maps with MAP_RANGE.

    Attributes:
        change: R. [H, W] float32 in 0..1
        truth_change: G. [H, W] float32 in 0..1
        excess: E. [H, W] float32 in 0..1
        is_static: The truth changes by less than STATIC_THRESHOLD and neither frame's motion mask is set. [H, W] bool
        is_valid: The pixels the camera sees; None for all. [H, W] bool
    """

    change: np.ndarray
    truth_change: np.ndarray
    excess: np.ndarray
    is_static: np.ndarray
    is_valid: np.ndarray | None = None

    def means(self, values: np.ndarray) -> tuple[float | None, float | None]:
        """Means of values [H, W] over the static and the other pixels that the camera sees; None over none."""
        if self.is_valid is None:
            return part_means(values, self.is_static)
        return part_means(values[self.is_valid], self.is_static[self.is_valid])

    @property
    def static_share(self) -> float:
        """Share of static pixels among those that the camera sees."""
        seen = self.is_static if self.is_valid is None else self.is_static[self.is_valid]
        return float(seen.mean()) if seen.size else 0.0


@dataclass(frozen=True, slots=True)
class PairRow:
    """Two neighbouring frames of one camera. Means over pixels, colours in 0..1; None over an empty set.

    Attributes:
        frame_index: The later frame; the other is one before it.
        clip_index: Clip of the later frame.
        camera, is_held_out: Which camera.
        is_boundary: Whether the earlier frame lies in the clip before.
        change_static, change_moving: R on static pixels, and on all others.
        truth_change_static, truth_change_moving: G.
        excess_static, excess_moving: E.
        static_share: Share of static pixels.
        two_clips_static, two_clips_moving: Of a boundary: |clip before it, rendered at the later frame's instant, minus
            the later clip there|, an evaluation of one instant by two clips. None inside clips.
        is_extrapolated: The instant lies outside what the clip before was trained on: always so at a boundary.
        is_held: That clip answers with its last frame, because its field ends there; two_clips is R then.
    """

    frame_index: int
    clip_index: int
    camera: str
    is_held_out: bool
    is_boundary: bool
    change_static: float | None
    change_moving: float | None
    truth_change_static: float | None
    truth_change_moving: float | None
    excess_static: float | None
    excess_moving: float | None
    static_share: float
    two_clips_static: float | None = None
    two_clips_moving: float | None = None
    is_extrapolated: bool = False
    is_held: bool = False

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return asdict(self)


def change_of(image: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """Mean over channels of the absolute difference of two pictures in 0..1. [H, W] float32"""
    difference = np.subtract(image, previous, dtype=np.float32)
    return np.einsum("hwc->hw", np.abs(difference, out=difference)) / np.float32(3)


def excess_of(change: np.ndarray, truth_change: np.ndarray) -> np.ndarray:
    """E of R and G: what changes in the render beyond what changes in the truth. [H, W] float32"""
    return np.maximum(change - truth_change, np.float32(0))


def seam_maps(
    image: np.ndarray,
    previous_image: np.ndarray,
    truth: np.ndarray,
    previous_truth: np.ndarray,
    is_moving: np.ndarray,
    is_valid: np.ndarray | None = None,
) -> SeamMaps:
    """R, G, E and the static pixels of two neighbouring frames.

    Args:
        image, previous_image: Renders in 0..1, the later frame first. [H, W, 3]
        truth, previous_truth: The camera's own pictures, in 0..1. [H, W, 3]
        is_moving: Motion masks of both frames together. [H, W] bool
        is_valid: The pixels the camera sees, None for all; the others are black in all four pictures. [H, W] bool
    """
    change, truth_change = change_of(image, previous_image), change_of(truth, previous_truth)
    is_static = stands_still(truth_change) & ~is_moving
    return SeamMaps(change, truth_change, excess_of(change, truth_change), is_static, is_valid)


def stands_still(truth_change: np.ndarray) -> np.ndarray:
    """Pixels that change by no more than noise does, by how much the truth changes [H, W]. [H, W] bool"""
    from scipy import ndimage  # the window shows figures long before it blurs anything

    sigma_px = BLUR_PX_PER_640 * max(truth_change.shape[1] / 640.0, 0.5)
    return ndimage.gaussian_filter(truth_change, sigma_px, mode="nearest", truncate=3.0) < STATIC_THRESHOLD


def part_means(values: np.ndarray, is_static: np.ndarray) -> tuple[float | None, float | None]:
    """Means of values over the static and the other pixels; None over no pixels and for values not finite."""
    static, moving = (_finite_mean(values[part]) for part in (is_static, ~is_static))
    return static, moving


def _finite_mean(values: np.ndarray) -> float | None:
    mean = float(values.mean(dtype=np.float64)) if values.size else np.nan
    return mean if np.isfinite(mean) else None


# ---------------------------------------------------------------- rows brought together


def summarize(rows: Sequence[PairRow]) -> dict[str, Any]:
    """Seams of all boundaries, and the normal figures inside the clips. JSON-able.

    Returns:
        boundaries: one entry per boundary, in order: frame_index, clips (before and after), the measures of `_measures`
            over all cameras, `held_out` and `trained_on`, `cameras` (the same per name) and `worst_camera`.
        cameras: the measures per camera over all boundaries.
        means: `all`, `held_out`, `trained_on`: the measures over all boundaries, and `boundary` and `interior`, the
            means of every figure over boundary and interior pairs.
        definitions: what the measures are, in words, with the constants.
    """
    boundaries = []
    at: dict[int, list[PairRow]] = {}  # by frame; looked up once for all, since a long capture has many boundaries
    inside: dict[int, list[PairRow]] = {}  # by clip
    for row in rows:
        if row.is_boundary:
            at.setdefault(row.frame_index, []).append(row)
        else:
            inside.setdefault(row.clip_index, []).append(row)
    for frame_index, chosen in sorted(at.items()):
        clips = [chosen[0].clip_index - 1, chosen[0].clip_index]
        around = chosen + [row for clip in clips for row in inside.get(clip, ())]
        cameras = _by_camera(around)
        scores = {name: found["score"] for name, found in cameras.items() if found["score"] is not None}
        boundaries.append(
            {
                "frame_index": frame_index,
                "clips": clips,
                **_measures(around),
                **{group: _measures(_of_group(around, group)) for group in GROUPS},
                "cameras": cameras,
                "worst_camera": max(scores, key=lambda name: scores[name]) if scores else None,
            }
        )
    groups = {"all": list(rows), **{group: _of_group(rows, group) for group in GROUPS}}
    return {
        "boundaries": boundaries,
        "cameras": _by_camera(rows) if boundaries else {},
        "means": {
            name: {
                **_measures(part),
                "boundary": _means([row for row in part if row.is_boundary], (*_FIGURES, *_TWO_CLIPS)),
                "interior": _means([row for row in part if not row.is_boundary], _FIGURES),
            }
            for name, part in groups.items()
        },
        "definitions": DEFINITIONS,
    }


DEFINITIONS = {
    "change": "R: mean over channels of |render - render one frame before|, colours in 0..1",
    "truth_change": "G: the same of what the camera took",
    "excess": "E: max(R - G, 0) per pixel",
    "static": f"pixels with a blurred G below {STATIC_THRESHOLD * 255:g}/255, outside the motion masks; moving: others",
    "score": "mean over boundaries and cameras of: E on static pixels at the boundary, less the median of the interior"
    " pairs of the two clips in the same camera, in units of 1/255; 0: no seam",
    "ratio": "mean R of the boundaries / mean R of the interior pairs; null where the latter is 0; 1: no seam. Moving"
    " pixels may move more at a boundary than elsewhere: truth_ratio_moving is the same of G",
    "two_clips": "mean over channels of |clip before the boundary, asked beyond its last frame, - clip after it, at its"
    " first frame|; extrapolated, and equal to R where is_held",
    "map_range": f"maps of R, G and E are drawn from {MAP_RANGE[0]:g} to {MAP_RANGE[1]:g} in every frame",
}


def _measures(rows: Sequence[PairRow]) -> dict[str, float | None]:
    """Score and ratios of the boundary pairs among these rows against the interior ones."""
    boundary = [row for row in rows if row.is_boundary]
    interior = [row for row in rows if not row.is_boundary]
    normal: dict[tuple[str, int], list[float]] = {}
    for row in interior:
        if row.excess_static is not None:
            normal.setdefault((row.camera, row.clip_index), []).append(row.excess_static)
    return {
        "score": mean_of([_score(row, normal) for row in boundary]),
        "ratio_static": ratio(boundary, interior, "change_static"),
        "ratio_moving": ratio(boundary, interior, "change_moving"),
        "truth_ratio_moving": ratio(boundary, interior, "truth_change_moving"),
    }


def _score(row: PairRow, normal: dict[tuple[str, int], list[float]]) -> float | None:
    """Excess of a boundary pair over the median of its camera's interior pairs in the two clips, 1/255."""
    around = [e for clip in (row.clip_index - 1, row.clip_index) for e in normal.get((row.camera, clip), [])]
    return score_of(row.excess_static, around)


def score_of(excess_static: float | None, around: Sequence[float]) -> float | None:
    """Seam score of one camera at one boundary, 1/255; None where one side of the comparison is missing.

    Args:
        excess_static: Mean E on static pixels at the boundary.
        around: The same of the interior pairs of the two clips.
    """
    if excess_static is None or not len(around):
        return None
    return 255.0 * (excess_static - float(np.median(around)))


def ratio(boundary: Sequence[PairRow], interior: Sequence[PairRow], name: str) -> float | None:
    """Mean of a field of PairRow over the first pairs / its mean over the others; None where there is no such value."""
    return ratio_of(*([getattr(row, name) for row in rows] for rows in (boundary, interior)))


def ratio_of(boundary: Sequence[float | None], interior: Sequence[float | None]) -> float | None:
    """Mean of the first values / mean of the others; None where there is none, or the latter is 0."""
    above, below = mean_of(boundary), mean_of(interior)
    return None if above is None or not below else above / below


def _means(rows: Sequence[PairRow], names: Sequence[str]) -> dict[str, Any]:
    """Means of every figure over the rows that have it, the number of rows, and how many lack one."""
    found: dict[str, Any] = {"n_pairs": len(rows)}
    missing = {}
    for name in names:
        values = [getattr(row, name) for row in rows]
        found[name] = mean_of(values)
        if rows and (n_missing := values.count(None)):
            missing[name] = n_missing
    return found | {"n_missing": missing}


_FIGURES = (
    *(f"{what}_{part}" for what in ("change", "truth_change", "excess") for part in ("static", "moving")),
    "static_share",
)
_TWO_CLIPS = ("two_clips_static", "two_clips_moving")


def _of_group(rows: Sequence[PairRow], group: str) -> list[PairRow]:
    return [row for row in rows if row.is_held_out == (group == "held_out")]


def _by_camera(rows: Sequence[PairRow]) -> dict[str, dict[str, Any]]:
    parts: dict[str, list[PairRow]] = {}
    for row in rows:
        parts.setdefault(row.camera, []).append(row)
    return {name: {"is_held_out": part[0].is_held_out, **_measures(part)} for name, part in parts.items()}
