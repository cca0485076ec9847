"""The job of a worker, made of a project as it is now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.project.project import Project
from app.training.messages import TrainJob
from engine.capture.clip import Clip
from engine.clip_files.clip_header import SettingValue
from engine.portable import NATIVE, Processor
from engine.training.config import config_of


def train_job(
    project: Project,
    clip: Clip,
    *,
    holdout: Sequence[int] = (),
    overrides: Mapping[str, SettingValue] | None = None,
    is_window_open: bool = True,
    live_view: str = "live",
    n_beside: int = 1,
    n_everywhere: int = 1,
    claim: str = "",
    cpu: Processor = NATIVE,
) -> TrainJob:
    """The job of training a clip.

    Args:
        holdout: Camera indices never trained on.
        overrides: Settings of this clip; those of the project when None.
        n_beside, n_everywhere, claim, cpu: See TrainJob.
    """
    settings, document = project.settings, project.document
    overrides = dict(settings.overrides if overrides is None else overrides)
    reference, previous = project.inherited_index(clip.clip_index), None
    config, frames = config_of(overrides), settings.frames
    if config.backgrounds == "clip" and (reference is None or reference <= clip.clip_index):
        first = 0 if frames is None else frames[0]
        frames = (first, first + clip.stop)  # so that nothing can depend on later ones, which may not exist yet
    if clip.clip_index != settings.reference_clip and config.follows_previous:
        previous = project.previous_index(clip.clip_index)
    return TrainJob(
        key=project.clip_name(clip.clip_index),
        clip=clip,
        fingerprint=settings.fingerprint,
        scale=settings.scale,
        reference=None if reference is None else project.clip_name(reference),
        previous=None if previous is None else project.clip_name(previous),
        holdout=tuple(holdout),
        seed=settings.seed,
        overrides=overrides,
        frames=frames,
        exclusions=document.exclusions,
        regions=tuple(document.regions),
        is_window_open=is_window_open,
        live_view=live_view,
        n_beside=n_beside,
        n_everywhere=n_everywhere,
        claim=claim,
        cpu=cpu,
    )
