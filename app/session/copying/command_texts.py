"""CommandTexts: steps in the window, done or possible, as a command line and as Python."""

from __future__ import annotations

from collections.abc import Callable

from app.command_text.command_text import CommandText
from app.command_text.job_command import export_command, mend_command, training_command, version_command
from app.command_text.step_command import edit_command, step_command
from app.document.changes.edit_changes import edit_with
from app.export.export_choices import ExportChoices, ExportContext
from app.export.jobs.answers import Answers
from app.mending.request import MendRequest
from app.project.project import Project
from engine.errors import ProjectError


class CommandTexts:
    """For one thread; makes texts when they are asked for and keeps none.

    Args:
        project: Gives the open project; None where there is none.
        is_finished: Whether training a clip would replace a finished one.
        n_frames: Gives the number of frames of the open capture; None where that is not known.
    """

    def __init__(
        self,
        project: Callable[[], Project | None],
        is_finished: Callable[[int], bool],
        n_frames: Callable[[], int | None] = lambda: None,
    ) -> None:
        self._find, self._is_finished, self._n_frames = project, is_finished, n_frames

    def step(self, n_before: int = 0) -> CommandText:
        """A step of the history that was done.

        Args:
            n_before: How many steps before the last one.
        Raises:
            ProjectError: There is no such step.
        """
        project = self._project()
        past = project.history.past
        if not 0 <= n_before < len(past):
            raise ProjectError("There is no step to copy.", hint="Change something first.")
        before = past[len(past) - 1 - n_before].document
        after = past[len(past) - n_before].document if n_before else project.document
        found = step_command(project.folder, before, after, self._n_frames())
        if found is None:
            raise ProjectError("This step has changed nothing.")
        return found

    def edit(self, edit_id: int) -> CommandText:
        """Puts such an edit on top of the stack. Raises ProjectError where there is none."""
        project = self._project()
        return edit_command(project.folder, edit_with(project.document, edit_id))

    def training(self, clip_index: int) -> CommandText:
        """Trains a clip, or trains it again. Raises ProjectError where nothing is open."""
        project = self._project()
        return training_command(project.folder, project.settings, clip_index, is_again=self._is_finished(clip_index))

    def version(self, clip_index: int, number: int) -> CommandText:
        """Brings back an earlier version of a clip. Raises ProjectError where nothing is open."""
        return version_command(self._project().folder, clip_index, number)

    def mend(self, request: MendRequest, method: str) -> CommandText:
        """Mends a boundary or a stretch of frames. Raises ProjectError where nothing is open."""
        return mend_command(self._project().folder, after=request.after, frames=request.frames, method=method)

    def export(self, context: ExportContext, choices: ExportChoices) -> CommandText:
        """Exports the choices of the dialog. Raises ProjectError where nothing is open."""
        return export_command(self._project().folder, Answers(context, choices).make_job())

    def _project(self) -> Project:
        project = self._find()
        if project is None:
            raise ProjectError("No capture is open.", hint="Open a capture first.")
        return project
