"""Builds the real training of a job from its store. Imports torch only when called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.background.kernels import warm_up_reporting
from app.training.messages import TrainJob
from app.training.store import ClipStore
from app.training.worker.interface import Training
from engine.backends.table import process_backend
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.errors import ProjectError
from engine.gate.regions import GateRegion
from engine.progress import Progress, ReportProgress
from engine.training.config import TrainConfig, config_of

if TYPE_CHECKING:
    from engine.training.clip_training import ClipTraining


def build_training(job: TrainJob, store: ClipStore, report: ReportProgress) -> Training:
    """Compile missing kernels, open the capture, read the reference clip if needed, set the training up.

    Raises:
        CaptureError, ProjectError: Files are missing, damaged or do not fit together.
    """
    report(Progress("Starting", 0.0))
    warm_up_reporting(report)
    capture = store.capture(scale=job.scale, frames=job.frames)
    if capture.fingerprint != job.fingerprint:
        raise ProjectError(
            "The capture is not the one this project was made for.",
            hint="Put the original capture back, or make a new project.",
            path=capture.path,
        )
    if job.clip.stop > capture.n_frames:
        raise ProjectError(f"Clip {job.clip_index} ends after the {capture.n_frames} frames of the capture.")
    return clip_training(
        capture.without(job.exclusions),
        job.clip,
        config_of(job.overrides),
        holdout=job.holdout,
        seed=job.seed,
        reference=None if job.reference is None else store.clip(job.reference),
        previous=None if job.previous is None else store.clip(job.previous),
        prep_dir=store.shared,
        regions=job.regions,
        report=report,
    )


def clip_training(
    capture: Capture,
    clip: Clip,
    config: TrainConfig,
    *,
    holdout: Sequence[int],
    seed: int,
    reference: ClipState | None,
    prep_dir: Path,
    regions: Sequence[GateRegion],
    report: ReportProgress,
    previous: ClipState | None = None,
) -> ClipTraining:
    """The training of one clip, with some settings; nothing is prepared yet.

    Args:
        holdout: Camera indices never trained on.
        seed: Fixes random numbers.
        reference: The clip to inherit from.
        prep_dir: Folder for files that clips share.
        regions: Where the user overrules the gate.
        report: Receives the progress of a preparation.
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
        prep_dir=prep_dir,
        report=report,
        previous=previous,
        regions=regions,
    )
