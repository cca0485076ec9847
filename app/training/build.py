"""Builds the real training of a job from the project's files. Imports torch only when called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.background.kernels import warm_up_reporting
from app.project.clips.clip_versions import read_finished
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.interface import Training
from app.training.messages import TrainJob
from engine.backends.table import process_backend
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.errors import ProjectError
from engine.progress import Progress, ReportProgress
from engine.training.config import TrainConfig, config_of

if TYPE_CHECKING:
    from engine.training.clip_training import ClipTraining


def build_training(job: TrainJob, report: ReportProgress) -> Training:
    """Compile what is not compiled yet, open the capture, read the reference clip if needed, set the training up.

    Raises:
        CaptureError, ProjectError: Files are missing, damaged or do not fit together.
    """
    report(Progress("Starting", 0.0))
    warm_up_reporting(report)
    project = open_project(job.project, is_writable=False)
    capture = open_capture(Path(job.capture), scale=job.scale, frames=job.frames, follow_links=job.follow_links)
    if capture.fingerprint != project.settings.fingerprint:
        raise ProjectError(
            "The capture is not the one this project was made for.",
            hint="Put the original capture back, or make a new project.",
            path=job.capture,
        )
    capture = capture.without(project.document.exclusions)
    clips = project.clips(capture.n_frames)
    if not 0 <= job.clip_index < len(clips):
        raise ProjectError(f"There is no clip {job.clip_index}; the capture has {len(clips)}.", path=job.project)
    base = project.inherited_index(job.clip_index)
    reference = None if base is None else read_finished(project, base)
    config = config_of(job.overrides)
    previous = None
    is_first = job.clip_index == project.settings.reference_clip
    if not is_first and (config.field == "continue" or config.start == "previous"):
        previous = _read_previous(project, job.clip_index)
    return clip_training(
        project,
        capture,
        clips[job.clip_index],
        config,
        holdout=job.holdout,
        seed=job.seed,
        reference=reference,
        previous=previous,
        report=report,
    )


def clip_training(
    project: Project,
    capture: Capture,
    clip: Clip,
    config: TrainConfig,
    *,
    holdout: Sequence[int],
    seed: int,
    reference: ClipState | None,
    report: ReportProgress,
    previous: ClipState | None = None,
) -> ClipTraining:
    """The training of one clip of an open project, with some settings; nothing is prepared yet.

    Args:
        holdout: Camera indices never trained on.
        seed: Fixes what is random.
        reference: What the clip inherits from.
        report: Told how far a preparation is.
        previous: The clip that it continues from.
    """
    from engine.training.clip_training import ClipTraining  # torch takes a second to import
    from engine.training.variants.variant_method import method_of

    return ClipTraining(
        capture,
        clip,
        config=config,
        method=method_of(config, previous=previous),
        backend=process_backend(),
        holdout=holdout,
        reference=reference,
        seed=seed,
        prep_dir=project.prep_dir,
        report=report,
        previous=previous,
        regions=project.document.regions,
    )


def _read_previous(project: Project, clip_index: int) -> ClipState:
    """The trained clip that this one continues from.

    Raises:
        ProjectError: It is not trained.
    """
    before = project.previous_index(clip_index)
    if not project.is_trained(before):
        raise ProjectError(
            f"Clip {clip_index} continues clip {before}, which is not trained.",
            hint=f"Train clip {before} first.",
        )
    return read_finished(project, before)
