"""Cost of training a capture, before there is a project: from the answers that a user is about to give."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

from app.project.opening.opening_answers import OpeningAnswers, working_size
from app.status import OpeningForecast
from engine.capture.capture import Capture
from engine.capture.clip import split_clips
from engine.errors import PreparationError
from engine.training.config import TrainConfig
from engine.training.plan.plan import Footage, StepTime, TrainingPlan, expected_anchors, make_plan

_ANCHOR_BYTES, _FIELD_MB = 40.0, 0.25
"""Size of a stored clip, measured on finished projects: for each anchor that it adds, and for the rest of it."""


def forecast_opening(capture: Capture, answers: OpeningAnswers, *, step_time: StepTime, place: Path) -> OpeningForecast:
    """Cost of training with these answers.

    Args:
        capture: At any scale.
        answers: Those that the project is going to begin with.
        step_time: Times steps on this machine; may take seconds.
        place: Folder on the disk that the project is going to lie on.
    Raises:
        CaptureError, PreparationError: The answers do not fit the capture.
    """
    first, stop = answers.frames or (0, capture.layout.n_frames)
    width, height = working_size(capture, answers.scale)
    n_cameras = len(capture.rig) - len(answers.holdout)
    if n_cameras < 2:
        raise PreparationError(f"Only {n_cameras} cameras are left for training; two are needed.")
    footage = Footage(width, height, n_cameras, len(answers.holdout), stop - first)
    clips, config = split_clips(stop - first, min(answers.clip_length, stop - first)), TrainConfig()
    plans: dict[tuple[bool, int], TrainingPlan] = {}
    total_s: float | None = 0.0
    for clip in clips:
        kind = clip.clip_index > 0, clip.n_frames
        if kind not in plans:
            plans[kind] = make_plan(
                footage, clip, config, is_source=kind[0], reference=None, history=(), step_time=step_time
            )
        seconds = plans[kind].seconds
        total_s = None if total_s is None or seconds is None else total_s + seconds
    n_static, n_moving = expected_anchors(footage, config, None)
    disk_mb = len(clips) * (_FIELD_MB + n_moving * _ANCHOR_BYTES / 1e6) + n_static * _ANCHOR_BYTES / 1e6
    memory = [plan.memory_mb for plan in plans.values()]
    return OpeningForecast(
        n_clips=len(clips),
        size=(width, height),
        n_pictures=n_cameras * (stop - first),
        reference_s=plans[False, clips[0].n_frames].seconds,
        total_s=total_s,
        memory_mb=max(memory, default=None),
        disk_mb=disk_mb,
        free_mb=free_mb(place),
    )


def free_mb(place: Path) -> float | None:
    """Room on the disk of a folder that need not exist yet, 10^6 bytes; None where it is unknown."""
    for folder in (place, *place.parents):
        with suppress(OSError):
            return shutil.disk_usage(folder).free / 1e6
    return None
