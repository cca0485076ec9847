"""estimate_offsets: asks every source in turn and puts their answers together.

Tags and sound come first: they show how far apart cameras are at all. Then pictures are compared around the same
moment, as far as that is known, which gives parts of a frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.parallel import map_ordered, n_cores
from engine.progress import Progress, ReportProgress
from engine.synchronisation.audio import audio_estimate
from engine.synchronisation.combining import combine
from engine.synchronisation.epipolar import epipolar_curves
from engine.synchronisation.motion_energy import motion_curves
from engine.synchronisation.motion_pictures import MotionPictures, evenly, motion_pictures
from engine.synchronisation.recording import Recording, recordings_of
from engine.synchronisation.solving import OffsetSolution, solve_curves
from engine.synchronisation.synchronisation import Estimate, SourceName, Synchronisation
from engine.synchronisation.tags import tag_estimates

MAX_FRAMES = 150
"""Pictures of each camera that are compared, from the middle of what all recorded."""
MIN_FRAMES = 16
"""Fewer successive pictures are not enough."""
EPIPOLAR_SIGMA_FRAMES, MOTION_SIGMA_FRAMES = 0.06, 0.9
"""The uncertainty apart from the scatter of pairs: views differ, and those of neighbours in the same way."""


def synchronise(capture: Capture, *, report: ReportProgress = lambda progress: None) -> Synchronisation:
    """`estimate_offsets` of a capture with its calibration: what is left after the offsets it has already.

    Raises:
        CaptureError: Pictures cannot be read.
    """
    return estimate_offsets(recordings_of(capture), fps=capture.fps, rig=capture.rig, report=report)


def estimate_offsets(
    recordings: Sequence[Recording],
    *,
    fps: float,
    rig: CameraRig | None = None,
    max_offset_s: float = 1.0,
    report: ReportProgress = lambda progress: None,
) -> Synchronisation:
    """Find how far each camera is ahead, from tags, sound, and what is seen to move.

    Args:
        recordings: One per camera.
        fps: Frames per second in which offsets are counted.
        rig: The calibration; with it, where things move is compared, not only how much.
        max_offset_s: How far pictures are compared beyond what tags and sound say.
        report: Called often with how far it is; may raise to cancel.
    Raises:
        CaptureError: Pictures cannot be read.
        ValueError: rig is not of as many cameras.
    """
    if rig is not None and len(rig) != len(recordings):
        raise ValueError(f"{len(recordings)} recordings, {len(rig)} cameras")
    names = [recording.name for recording in recordings]
    n = max(len(recordings), 1)
    timecode, created = tag_estimates(recordings, fps)
    audio = audio_estimate(recordings, fps, after_camera=lambda done: report(Progress("sound", done / n)))
    estimates = [timecode, audio]
    rough = combine(names, estimates, fps).offsets_frames
    motions, starts = _look(recordings, fps, np.round(rough), report)
    if motions is not None:
        max_lag = max(round(max_offset_s * fps), 2)
        if rig is not None:
            curves = epipolar_curves(
                motions,
                starts,
                rig,
                max_lag,
                after_pair=lambda done, n_pairs: report(Progress("where things move", done / n_pairs)),
            )
            estimates.append(_visual("epipolar", solve_curves(n, curves), len(curves), EPIPOLAR_SIGMA_FRAMES))
        report(Progress("how much moves", 0.0))
        curves = motion_curves(motions, starts, fps, max_lag)
        estimates.append(_visual("motion", solve_curves(n, curves), len(curves), MOTION_SIGMA_FRAMES))
    report(Progress("done", 1.0))
    return combine(names, [*estimates, created], fps)


def _look(
    recordings: Sequence[Recording], fps: float, rough_frames: np.ndarray, report: ReportProgress
) -> tuple[list[MotionPictures] | None, list[float]]:
    """The motion around the same moment in each camera, and the frame, by `fps`, where each of them begins. None where
    there are too few frames."""
    lengths = np.array([recording.times_s[-1] * fps for recording in recordings])
    first, last = float((-rough_frames).max()), float((lengths - rough_frames).min())
    middle = (first + last) / 2
    windows = []
    for recording, rough in zip(recordings, rough_frames, strict=True):
        times = recording.times_s * fps - rough
        begin = int(np.searchsorted(times, middle - MAX_FRAMES / 2 - 1e-6))
        end = int(np.searchsorted(times, middle + MAX_FRAMES / 2 - 1e-6))
        windows.append((begin, end))
    if min((end - begin for begin, end in windows), default=0) < MIN_FRAMES:
        return None, []
    motions: list[MotionPictures] = []
    starts: list[float] = []
    rows = list(range(len(recordings)))
    for at in range(0, len(rows), n_cores()):
        report(Progress("what moves", at / len(rows), f"camera {at + 1} of {len(rows)}"))
        chunk = rows[at : at + n_cores()]
        for motion in map_ordered(lambda row: motion_pictures(recordings[row], *windows[row]), chunk):
            even, start = evenly(motion, fps)
            motions.append(even)
            starts.append(start)
    return motions, starts


def _visual(source: SourceName, solution: OffsetSolution, n_curves: int, own_sigma: float) -> Estimate:
    """The answer of pictures as an estimate."""
    n_known = int((solution.groups >= 0).sum())
    if n_known == 0:
        note = "No two cameras see the same motion."
    else:
        good = np.nanmean(solution.agreements)
        note = f"{len(solution.pairs)} of {n_curves} pairs are informative; {100 * good:.0f} % of them agree."
    return Estimate(
        source=source,
        offsets_frames=solution.offsets_frames,
        sigmas_frames=np.hypot(solution.sigmas_frames, own_sigma),
        groups=solution.groups,
        pairs=solution.pairs,
        agreements=solution.agreements,
        note=note,
    )
