"""From first estimates to final cameras: matches are judged by the cameras, and cameras adjusted to the matches, in
turn, each time more strictly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from engine.calibration.matching.matching import KeyPoints, Pair, all_pairs
from engine.calibration.solving.bundle import Expectations, FreePoints, adjust, errors_px
from engine.calibration.solving.cameras import Cameras, with_lens
from engine.calibration.solving.mapping import FirstEstimate
from engine.calibration.solving.tracks import Tracks, build_tracks, cleaned, fitting_matches


class SolvingStage(NamedTuple):
    """One turn.

    Attributes:
        reach_px: At a width of 640, that sightings may be off.
        is_common: Whether cameras that are taken for alike have one lens, with its middle in the middle of the picture.
        is_last: Whether cameras have the lens that was asked for.
    """

    reach_px: float
    is_common: bool = False
    is_last: bool = False


ROUGH = (SolvingStage(16.0, is_common=True), SolvingStage(12.0, is_common=True), SolvingStage(6.0))
"""While estimates are rough."""
FINE = (SolvingStage(3.0, is_last=True), SolvingStage(2.0, is_last=True))
"""At the end."""
ALIKE = 0.06
"""Standard deviation of ln(focal length) among cameras that are taken for alike."""
MIN_REACH_PX = 1.5
N_ITERATIONS = 25


@dataclass(frozen=True, slots=True)
class CalibrationSolution:
    """Cameras that were found and what they saw.

    Attributes:
        rows: Which cameras, rising. [R]
        cameras: In this order; pixels of the pictures that are matched.
        tracks: Points and sightings.
        are_alike: Whether focal lengths of one size of picture were expected to be near each other.
    """

    rows: np.ndarray
    cameras: Cameras
    tracks: Tracks
    are_alike: bool

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
    stages: Sequence[SolvingStage],
    progress: Callable[[float], None] = lambda _: None,
) -> CalibrationSolution:
    """Adjust an estimate until points land where they were seen.

    Args:
        estimate: Of some of the cameras.
        key_points: Of all cameras.
        matches: By looks alone, of all cameras.
        sizes: Of all pictures. [C, 2]
        lens, is_shared: Of CalibrationOptions.
        stages: ROUGH or FINE.
        progress: Called with the share that is done.
    """
    rows, cameras = estimate.rows, estimate.cameras
    chosen = [key_points[row] for row in rows]
    pairs = all_pairs(len(rows))
    known = {(a, b): matches[int(rows[a]), int(rows[b])] for a, b in pairs}
    middles, widths = sizes[rows] / 2.0, sizes[rows, 0].astype(np.float64)
    per_640 = float(np.median(sizes[rows].max(1))) / 640
    tracks = Tracks.none()
    groups = np.unique(sizes[rows], axis=0, return_inverse=True)[1].reshape(-1)  # at other sizes lenses are others
    if is_shared:
        cameras = _with_one_lens(cameras, groups)
    for number, stage in enumerate(stages):
        reach_px = max(stage.reach_px * per_640, MIN_REACH_PX)
        if stage.is_last:
            cameras = with_lens(cameras, lens)
        tracks = build_tracks(fitting_matches(known, chosen, cameras, reach_px), chosen, cameras, reach_px)
        if len(tracks.points) < len(rows):
            break
        is_common = estimate.are_alike and stage.is_common
        expect = Expectations(groups=tuple(groups.tolist()) if is_shared or is_common else None)
        if estimate.are_alike:
            expect = replace(expect, focal=0.5 if is_common else ALIKE)
        if is_common:
            expect = replace(expect, principal=0.0, aspect=1e-6)
        cameras, shape = adjust(
            cameras,
            FreePoints(tracks.points),
            tracks.seen,
            middles=middles,
            widths=widths,
            expect=expect,
            focals=_medians(cameras.focals, groups) if estimate.are_alike else None,
            n_iterations=N_ITERATIONS,
        )
        tracks = cleaned(cameras, shape.points, tracks.seen, reach_px)
        progress((number + 1) / len(stages))
    return CalibrationSolution(rows, cameras, tracks, estimate.are_alike)


def _with_one_lens(cameras: Cameras, groups: np.ndarray) -> Cameras:
    """The same cameras, each with the lens in the middle of its group."""
    return replace(
        cameras,
        focals=_medians(cameras.focals, groups),
        aspects=_medians(cameras.aspects, groups),
        principal=_medians(cameras.principal, groups),
        lens_params=_medians(cameras.lens_params, groups),
    )


def _medians(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """The median of each camera's group, per column."""
    return np.array([np.median(values[groups == group], axis=0) for group in groups])
