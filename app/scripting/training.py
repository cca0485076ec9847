"""Training one clip and waiting for it, with a failure as an error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from app.evaluation.headless import BAD_INPUT_KINDS, ClipOutcome, train_clips
from app.project.project import Project
from app.status import TrainingStatus
from app.training.service import Launch, TrainingService
from engine.capture.capture import Capture
from engine.clip_files.clip_header import SettingValue
from engine.errors import ProjectError, TrainingError

if TYPE_CHECKING:
    from app.scripting.scripted_project import TellTraining


def train_one(
    project: Project,
    capture: Capture,
    clip_index: int,
    *,
    launch: Launch,
    on_progress: TellTraining | None,
    is_again: bool,
    own: Mapping[str, SettingValue] | None,
) -> ClipOutcome:
    """Train a clip and wait; see ScriptedProject.train_clip."""
    service = TrainingService(
        project,
        project.clips(capture.n_frames),
        holdout=capture.camera_indices(project.settings.holdout),
        launch=launch,
        is_window_open=False,
    )

    def tell(status: TrainingStatus) -> None:
        if on_progress is not None:
            on_progress(status)

    try:
        (outcome,) = train_clips(
            service,
            [clip_index],
            on_status=tell,
            on_event=lambda event: None,
            on_outcome=lambda outcome: None,
            is_again=is_again,
            own=own,
        )
    finally:
        service.close()
    if outcome.state in ("trained", "skipped"):
        return outcome
    is_input = outcome.state == "damaged" or outcome.kind in BAD_INPUT_KINDS
    error = ProjectError if is_input else TrainingError
    raise error(outcome.message or f"The training of clip {clip_index} was stopped.", hint=outcome.hint)
