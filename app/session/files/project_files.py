"""ProjectFiles: asks what to do with a project that does not open as it is, and saves the open one somewhere else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.document.storing.recovery import DamagedProject
from app.export.show_in_folder import show_in_folder
from app.project.opening.opening import LostCapture, OtherCapture
from app.project.project import Project
from app.project.project_copy import copy_bytes, copy_project
from app.session.files.file_commands import AskSaveAs, CancelSaveAs, FileCommand, SaveProjectAs, ShowProjectFolder
from app.session.files.file_questions import (
    SAVING,
    FileQuestion,
    RecoveryQuestion,
    RelocationQuestion,
    SaveAsQuestion,
    SavingQuestion,
)
from app.session.notices import Notices
from app.session.projects.project_commands import OpenCapture, OpenProject
from engine.errors import ProjectError

T = TypeVar("T")


class ProjectFiles:
    """For one thread, which does not wait.

    Args:
        jobs, notices: Of the session.
        ask: Puts a question to the user, or withdraws it.
        open_project: Opens a project.
        settle: Waits a moment until edits are on disk.
    """

    def __init__(
        self,
        jobs: Jobs,
        notices: Notices,
        *,
        ask: Callable[[FileQuestion | None], None],
        open_project: Callable[[OpenProject], None],
        settle: Callable[[], object],
    ) -> None:
        self._jobs, self._notices = jobs, notices
        self._ask, self._open_project, self._settle = ask, open_project, settle
        self._saving: BackgroundJob | None = None

    def ask_about(self, asked: OpenCapture, error: Exception) -> bool:
        """A project does not open. Whether the user is asked how to continue."""
        if isinstance(error, DamagedProject) and error.recovery is not None:
            self._ask(RecoveryQuestion(error.recovery))
        elif isinstance(error, LostCapture) and error.project is not None and error.path is not None:
            self._ask(RelocationQuestion(error.project, error.path))
        elif isinstance(error, OtherCapture) and error.project is not None and asked.choices.capture is not None:
            self._ask(RelocationQuestion(error.project, error.known, asked.choices.capture))
        else:
            return False
        return True

    def apply(self, command: FileCommand, project: Project | None, *, is_training: bool) -> None:
        """Carry out a command.

        Raises:
            ProjectError: Not now; states the cause.
        """
        match command:
            case AskSaveAs():
                self._measure(_checked(project, is_training=is_training))
            case SaveProjectAs(folder=folder):
                self._save(_checked(project, is_training=is_training), folder)
            case CancelSaveAs():
                if self._saving is not None:
                    self._saving.context.cancel()
            case ShowProjectFolder(folder=folder):
                self._start("Showing the folder", lambda context: show_in_folder(folder), lambda result: None)

    def _measure(self, project: Project) -> None:
        def work(context: JobContext) -> SaveAsQuestion:
            return SaveAsQuestion(project.folder, _free_name(project.folder), copy_bytes(project.folder))

        self._start("Reading the project", work, self._ask)

    def _save(self, project: Project, folder: Path) -> None:
        if self._saving is not None and self._saving.is_running:
            raise ProjectError("The project is being saved already.", hint="Wait until it is saved, or cancel.")
        self._settle()

        def saved(result: None) -> None:
            self._ask(None)
            self._notices.add("info", "The project was saved", f"It is now in {folder}.", "")
            self._open_project(OpenProject(folder))

        def failed(error: Exception) -> None:
            self._ask(None)
            self._failed(SAVING, error)

        def work(context: JobContext) -> None:
            copy_project(project, folder, context.report)

        self._saving = self._jobs.start(SAVING, work, saved, failed)
        self._ask(SavingQuestion(folder))

    def _start(self, name: str, work: Callable[[JobContext], T], done: Callable[[T], None]) -> None:
        self._jobs.start(name, work, done, lambda error: self._failed(name, error))

    def _failed(self, name: str, error: Exception) -> None:
        self._notices.add_failure(f"{name} has failed", error)


def _checked(project: Project | None, *, is_training: bool) -> Project:
    if project is None:
        raise ProjectError("No project is open.", hint="Open one first.")
    if is_training:
        raise ProjectError("A clip is being trained.", hint="Wait until it has ended, or stop training first.")
    return project


def _free_name(folder: Path) -> Path:
    """A free name next to a folder."""
    number = 2
    while (found := folder.absolute().with_name(f"{folder.name}-{number}")).exists():
        number += 1
    return found
