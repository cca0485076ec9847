"""examine: every check in turn, with what they look at decoded once; and what comes of it as one value."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.capture.capture import Capture
from engine.children.kind import ChildFailed
from engine.cloud.background.exposure_survey import ExposureSurvey
from engine.doctor.checks.black import check_black
from engine.doctor.checks.calibration import check_calibration
from engine.doctor.checks.exposure import check_exposure
from engine.doctor.checks.frame_counts import check_readable
from engine.doctor.checks.frozen import check_frozen
from engine.doctor.checks.holdout import check_holdout
from engine.doctor.checks.movement import check_movement
from engine.doctor.checks.synchronisation import check_synchronisation
from engine.doctor.epipolar import PairError, pair_errors
from engine.doctor.finding import Finding, in_order
from engine.doctor.neighbours import neighbour_pairs
from engine.doctor.picture_survey import PictureSurvey, look_at
from engine.doctor.quick import check_numbers
from engine.features.matching import match_pairs
from engine.freed_memory import return_freed_memory
from engine.progress import Progress, ReportProgress

STAGES = {
    "look": (0.0, 0.3),
    "movement": (0.3, 0.4),
    "time": (0.4, 0.6),
    "match": (0.6, 0.92),
    "calibration": (0.92, 1.0),
}
"""Where each stage begins and ends in the whole, by what they take on two cores."""
STAGE = "Capture doctor"
N_TIME_STAGES = 5
"""Of engine.synchronisation."""
USUAL_MATCH_S = 0.25
"""Of one pair, for the progress of a child process that reports none."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The findings about a capture.

    Attributes:
        findings: The worst first.
        camera_px: By how much features of each camera usually miss the lines on which its neighbours say they must
            lie, px at the working size; NaN where too little is known. [C]
        pairs: The same for every two cameras that were compared.
        n_features: Found in the background of each camera. [C]
        exposure: How the exposure of each camera changes.
        n_pictures: Looked at, of all cameras.
        seconds: It took.
    """

    findings: tuple[Finding, ...]
    camera_px: np.ndarray
    pairs: tuple[PairError, ...]
    n_features: np.ndarray
    exposure: ExposureSurvey
    n_pictures: int
    seconds: float


def examine(
    capture: Capture,
    *,
    report: ReportProgress = lambda progress: None,
    clock: Callable[[], float] = time.monotonic,
) -> Diagnosis:
    """Look at a capture from every side.

    Args:
        report: Called often with how far the whole is; what it raises ends the work.
        clock: Seconds; tests bring their own.
    Raises:
        DiskError: There is no room for the pictures that are matched.
    """
    began_s = clock()

    def part(stage: str) -> Callable[[float, str], None]:
        start, end = STAGES[stage]
        return lambda done, message="": report(Progress(STAGE, start + (end - start) * min(done, 1.0), message))

    tell_look, tell_movement = part("look"), part("movement")
    findings = check_numbers(capture)
    look = look_at(capture, lambda progress: tell_look(progress.done, f"looking at pictures of {progress.message}"))
    survey = look.exposure()
    findings += [
        *check_readable(look.unreadable),
        *check_black(look),
        *check_frozen(look),
        *check_movement(look, lambda done: tell_movement(done, "looking for moving cameras")),
        *check_exposure(survey),
    ]
    if not look.unreadable and len(capture.rig) > 1:
        findings += check_synchronisation(capture, _in_turn(part("time")))
    capture.close()  # no more pictures are looked at, and matching takes memory of its own
    return_freed_memory()
    found, errors, n_features = _compare(look, part("match"), part("calibration"))
    findings += found
    doubtful = {
        capture.rig.names.index(name)
        for finding in findings
        if finding.severity != "note"
        for name in finding.cameras
        if name in capture.rig.names
    }
    findings += check_holdout(capture.rig, capture.default_holdout, doubtful)
    return Diagnosis(
        findings=tuple(in_order(findings)),
        camera_px=_of_cameras(errors, len(capture.rig)),
        pairs=tuple(errors),
        n_features=n_features,
        exposure=survey,
        n_pictures=len(look.frames) * (len(capture.rig) - len(look.unreadable)),
        seconds=clock() - began_s,
    )


def _in_turn(tell: Callable[[float, str], None]) -> ReportProgress:
    """Progress of stages that follow each other as one that never goes back."""
    begun: list[str] = []

    def report(progress: Progress) -> None:
        if progress.stage not in begun:
            begun.append(progress.stage)
        done = min((len(begun) - 1 + progress.done) / N_TIME_STAGES, 1.0)
        tell(done, f"checking synchronisation: {progress.stage}")

    return report


def _compare(
    look: PictureSurvey, tell_match: Callable[[float, str], None], tell_fit: Callable[[float, str], None]
) -> tuple[list[Finding], list[PairError], np.ndarray]:
    """Match backgrounds of neighbours and judge the calibration by them."""
    rig = look.capture.rig
    rows = [row for row, camera in enumerate(look.cameras) if camera is not None]
    n_features = np.zeros(len(rig), dtype=np.int64)
    if len(rows) < 2:
        return [], [], n_features
    backgrounds = np.stack([camera.background for camera in look.cameras if camera is not None])
    height, width = backgrounds.shape[1:3]
    small = rig.subset(rows).resized(np.tile([width, height], (len(rows), 1)))
    listed = neighbour_pairs(small)
    began_s, usual_s = time.monotonic(), USUAL_MATCH_S * len(listed)

    def alive() -> None:
        spent_s = time.monotonic() - began_s
        tell_match(spent_s / (spent_s + 0.5 * usual_s), f"comparing {len(listed)} pairs of cameras")

    try:
        matches = match_pairs(backgrounds, listed, alive=alive)
    except ChildFailed as error:
        text = f"The calibration could not be checked: {error}."
        advice = "Try again; if it happens again, check free memory."
        return [Finding("calibration", "note", (), (), text, 1.0, advice)], [], n_features
    n_features[rows] = matches.n_features
    errors = pair_errors(small, matches.pairs)
    findings = check_calibration(
        small,
        matches.pairs,
        errors,
        frame=look.spread[0],
        tell=lambda done: tell_fit(done, "checking the calibration"),
    )
    ratio = float(rig.image_sizes[0, 0]) / width
    of_rig = [PairError(rows[e.first], rows[e.second], e.n_matches, e.median_px * ratio) for e in errors]
    return findings, of_rig, n_features


def _of_cameras(errors: list[PairError], n_cameras: int) -> np.ndarray:
    """Median over the pairs of each camera. [C]"""
    found = np.full(n_cameras, np.nan)
    for camera in range(n_cameras):
        own = [error.median_px for error in errors if error.n_matches and camera in (error.first, error.second)]
        if own:
            found[camera] = float(np.median(own))
    return found
