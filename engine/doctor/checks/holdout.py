"""Cameras that are good to hold out for measuring: inside the arrangement, neighbours on both sides, spread evenly.

A camera at the edge measures how far a scene can be extrapolated, not how well it was learned.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding
from engine.doctor.neighbours import angles_deg, apart_deg
from engine.doctor.words import counted, listed

N_NEAR = 6
WIDEST_GAP_DEG = 215.0
"""Between neighbours in turn, around a camera: more means that it has none on one side."""
ONE_IN = 10
"""So many cameras for each one held out."""
MOST = 6
FEWEST = 6
"""With fewer cameras all are needed for training."""


def widest_gaps_deg(rig: CameraRig) -> np.ndarray:
    """The widest angle around each camera, in the plane of its picture, without one of its nearest cameras. [C]"""
    angles = angles_deg(rig)
    np.fill_diagonal(angles, np.inf)
    gaps = np.full(len(rig), 360.0)
    for camera in range(len(rig)):
        near = np.argsort(angles[camera], kind="stable")[: min(N_NEAR, len(rig) - 1)]
        towards = (rig.centers[near] - rig.centers[camera]) @ rig.world_to_camera[camera, :2, :3].T
        around = np.sort(np.degrees(np.arctan2(towards[:, 1], towards[:, 0])))
        gaps[camera] = np.diff(np.append(around, around[0] + 360.0)).max()
    return gaps


def good_holdout(rig: CameraRig, doubtful: Collection[int] = ()) -> list[int]:
    """Rows of cameras to hold out, in order; none where cameras are few.

    doubtful: Cameras that something is wrong with.
    """
    n_wanted = min(max(round(len(rig) / ONE_IN), 1), MOST)
    if len(rig) < FEWEST:
        return []
    gaps, angles, apart = widest_gaps_deg(rig), angles_deg(rig), apart_deg(rig)
    candidates = [row for row in range(len(rig)) if gaps[row] <= WIDEST_GAP_DEG and row not in doubtful]
    if not candidates:
        return []
    off_diagonal = angles + np.where(np.eye(len(rig), dtype=bool), np.inf, 0.0)
    chosen = [min(candidates, key=lambda row: (round(float(gaps[row])), round(float(off_diagonal[row].min()), 1), row))]
    while len(chosen) < min(n_wanted, len(candidates)):
        left = [row for row in candidates if row not in chosen]
        chosen.append(max(left, key=lambda row: (round(float(apart[row, chosen].min()), 2), -row)))
    return sorted(chosen)


def check_holdout(rig: CameraRig, holdout: Sequence[str], doubtful: Collection[int] = ()) -> list[Finding]:
    """Suggest cameras where the capture names none, and say which of those it names are a poor measure."""
    rows = good_holdout(rig, doubtful)
    better = tuple(rig.names[row] for row in rows)
    if not holdout:
        if not better:
            return []
        text = (
            f"{listed(better)} {counted(better, 'is', 'are')} good to hold out for measuring: neighbours on all sides, "
            "evenly spread."
        )
        advice = "Hold them out to measure quality on pictures that training never sees."
        return [Finding("hold out", "note", better, (), text, 0.8, advice, Corrections(holdout=better))]
    gaps = widest_gaps_deg(rig)
    bad = tuple(
        name
        for name in holdout
        if name in rig.names and (gaps[rig.names.index(name)] > WIDEST_GAP_DEG or rig.names.index(name) in doubtful)
    )
    if not bad or not better:
        return []
    text = (
        f"{listed(bad)} {counted(bad, 'is', 'are')} held out, but {counted(bad, 'stands', 'stand')} at the edge of "
        f"the rig or {counted(bad, 'is', 'are')} doubtful; figures measured there mean little."
    )
    advice = f"{listed(better)} would be better."
    return [Finding("hold out", "note", bad, (), text, 0.7, advice, Corrections(holdout=better))]
