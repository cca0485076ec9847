"""FollowedRecording: clips are trained while their capture is still being recorded. Prints nothing."""

from __future__ import annotations

from collections.abc import Callable

from app.project.project import Project
from app.training.recording.intake import Intake, TakenIn, n_taken_of
from app.training.service import TrainingService
from engine.capture.capture import Capture
from engine.errors import ProjectError


class FollowedRecording:
    """Gives a service the clips of a capture as they come. For one thread.

    Args:
        project: Open for writing.
        capture: Opened as growing, with the frames of the project.
        service: Trains its clips.
        intake: Sees the frames come.
        on_taken: Told what was taken in.

    Attributes:
        capture: With the frames that are taken in now.
    """

    def __init__(
        self,
        project: Project,
        capture: Capture,
        service: TrainingService,
        intake: Intake,
        *,
        on_taken: Callable[[TakenIn], object],
    ) -> None:
        self.capture, self._project, self._service, self._intake = capture, project, service, intake
        self._on_taken = on_taken

    def more(self) -> list[int] | None:
        """Clips that have become complete since the last call; None once there will be no more.

        Raises:
            CaptureError: The folder is gone, or another capture lies there.
            ProjectError: The last clip was trained when the recording seemed to have ended.
            DiskError: The document cannot be written.
        """
        taken = self._intake.take()
        if taken is None:
            return None if self._intake.has_ended else []
        n_before = len(self._service.clips)
        check_unfinished(self._project, taken.stop)
        take_in(self._project, taken, self.capture)
        before, self.capture = self.capture, self.capture.grown(taken.stop)
        before.close()
        self._service.extend(self._project.clips(taken.stop))
        self._on_taken(taken)
        return list(range(n_before, len(self._service.clips)))


def take_in(project: Project, taken: TakenIn, capture: Capture) -> None:
    """Write into a project that frames were taken in. Raises ProjectError, DiskError."""
    document = taken.without_lost(project.document, capture)
    if document != project.document:
        project.change(document, "exclude frames that did not come")
    grown = taken.grown(project.settings)
    if project.settings.frames is None or grown.frames != project.settings.frames:
        project.update(grown)


def check_unfinished(project: Project, stop: int) -> None:
    """Check that no clip is trained that would have more frames now. stop: One past the last frame.

    Raises:
        ProjectError: One is.
    """
    known, n_whole = project.settings.frames, n_taken_of(project.settings)
    last = len(project.clips(n_whole)) if n_whole else 0
    if known is None or stop <= known[1] - known[0] or n_whole == known[1] - known[0] or not project.is_trained(last):
        return
    raise ProjectError(
        f"The recording seemed to have ended at frame {known[1] - known[0]}, and clip {last} was trained with the "
        "frames up to there.",
        hint="Train what was recorded since as a project of its own, or move that clip's file away to train it anew.",
        path=project.clip_path(last),
    )
