"""From first estimates to final cameras: matches are judged by the cameras, and cameras adjusted to the matches, in
turn, each time more strictly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from engine.calibration.bundle import Expectations, adjust, errors_px
from engine.calibration.cameras import N_LENS, Cameras
from engine.calibration.mapping import FirstEstimate
from engine.calibration.matching import KeyPoints, Pair, all_pairs, match_guided
from engine.calibration.tracks import Tracks, build_tracks, cleaned, fitting_matches

ROUGH = ((12.0, False), (6.0, False))
"""Stages while estimates are rough: pixels, at a width of 640, that sightings may be off; and whether matches are
looked for anew along epipolar lines, with the lens that was asked for."""
FINE = ((3.0, True), (2.0, True))
"""Stages at the end."""
MIN_REACH_PX = 1.5
MAX_ANGLE_DEG = 70.0
"""Between the views of two cameras that are matched anew: key points do not look alike from farther apart."""
N_ITERATIONS = 25


@dataclass(frozen=True, slots=True)
class Solution:
    """Cameras that were found and what they saw.

    Attributes:
        rows: Which cameras, rising. [R]
        cameras: In this order; pixels of the pictures that are matched.
        tracks: Points and sightings.
    """

    rows: np.ndarray
    cameras: Cameras
    tracks: Tracks

    @property
    def errors(self) -> np.ndarray:
        """Of each sighting, px. [N]"""
        return errors_px(self.cameras, self.tracks.points, self.tracks.seen)


def solve(
    estimate: FirstEstimate,
    key_points: list[KeyPoints],
    matches: dict[Pair, np.ndarray],
    sizes: np.ndarray,
    *,
    lens: str,
    is_shared: bool,
    stages: Sequence[tuple[float, bool]],
    progress: Callable[[float], None] = lambda _: None,
) -> Solution:
    """Adjust an estimate until points land where they were seen.

    Args:
        estimate: Of some of the cameras.
        key_points: Of all cameras.
        matches: By looks alone, of all cameras.
        sizes: Of all pictures. [C, 2]
        lens, is_shared: Of CalibrationOptions.
        stages: ROUGH or FINE.
        progress: Told the share that is done.
    """
    rows, cameras = estimate.rows, estimate.cameras
    chosen = [key_points[row] for row in rows]
    pairs = all_pairs(len(rows))
    known = {(a, b): matches[int(rows[a]), int(rows[b])] for a, b in pairs}
    middles, widths = sizes[rows] / 2.0, sizes[rows, 0].astype(np.float64)
    per_640 = float(np.median(sizes[rows].max(1))) / 640
    tracks = Tracks.none()
    is_shared = is_shared and len(np.unique(sizes[rows], axis=0)) == 1  # at other sizes lenses are others
    if is_shared:
        cameras = _with_one_lens(cameras)
    for number, (reach, is_last) in enumerate(stages):
        reach_px = max(reach * per_640, MIN_REACH_PX)
        if is_last:
            cameras = _with_lens(cameras, lens)
            near = [pair for pair in pairs if _angle_deg(cameras, pair) <= MAX_ANGLE_DEG]
            found = known | match_guided(chosen, cameras, near, reach_px)
        else:
            found = known
        tracks = build_tracks(fitting_matches(found, chosen, cameras, reach_px), chosen, cameras, reach_px)
        if len(tracks.points) < len(rows):
            break
        expect = Expectations(is_shared=is_shared)
        cameras, points = adjust(
            cameras,
            tracks.points,
            tracks.seen,
            middles=middles,
            widths=widths,
            expect=expect,
            n_iterations=N_ITERATIONS,
        )
        tracks = cleaned(cameras, points, tracks.seen, reach_px)
        progress((number + 1) / len(stages))
    return Solution(rows, cameras, tracks)


def _with_lens(cameras: Cameras, lens: str) -> Cameras:
    """The same cameras with the numbers of another lens model, those that both have taken over."""
    if cameras.lens == lens:
        return cameras
    params = np.zeros((len(cameras), N_LENS[lens]))
    n_both = min(params.shape[1], cameras.lens_params.shape[1])
    params[:, :n_both] = cameras.lens_params[:, :n_both]
    return replace(cameras, lens=lens, lens_params=params)


def _with_one_lens(cameras: Cameras) -> Cameras:
    """The same cameras, each with the lens in the middle of all."""
    n = len(cameras)
    return replace(
        cameras,
        focals=np.full(n, np.median(cameras.focals)),
        principal=np.tile(np.median(cameras.principal, axis=0), (n, 1)),
        lens_params=np.tile(np.median(cameras.lens_params, axis=0), (n, 1)),
    )


def _angle_deg(cameras: Cameras, pair: Pair) -> float:
    cosine = cameras.rotations[pair[0], 2] @ cameras.rotations[pair[1], 2]
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
