"""ProjectOpener: opens captures and projects on threads. The newest request wins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from app.background.jobs import JobContext, Jobs
from app.project.opening.opening import Opened, open_for_window
from app.project.projects_folder import projects_dir
from app.project.recents import RecentProject
from app.session.notices import Notice, Notices
from app.session.projects.project_commands import OpenCapture, OpenProject
from engine.capture.capture import Capture
from engine.errors import CaptureError, EngineError
from engine.text import printable


class ProjectOpener:
    """Carries out OpenCapture and OpenProject. For one thread, which does not wait.

    Args:
        jobs, notices: Of the session.
        project_dir: Folder for the project of the next capture; one in the folder of projects when None.
        take: Called by `Jobs.poll` with the opened project.
        open_path: Opens a path on the thread; tests bring their own.
        refuse: Called with a folder that does not open and the error, where the user was to be asked about it.
        ask: Called with a command that failed and the error. Whether the user is asked what to do, so that no notice is
            needed.
    """

    def __init__(
        self,
        jobs: Jobs,
        notices: Notices,
        take: Callable[[Opened], None],
        *,
        project_dir: Path | None = None,
        open_path: Callable[..., Opened] = open_for_window,
        refuse: Callable[[Path, EngineError], None] | None = None,
        ask: Callable[[OpenCapture, Exception], bool] | None = None,
    ) -> None:
        self.project_dir = project_dir
        self.projects = projects_dir()
        """The default folder of projects."""
        self._jobs, self._notices, self._take, self._open_path = jobs, notices, take, open_path
        self._refuse, self._ask = refuse, ask
        self._refusals: list[Notice] = []
        self._newest: object | None = None
        """Identifies the newest request."""

    def open(
        self,
        command: OpenCapture | OpenProject,
        *,
        current: Path | None,
        recent: Sequence[RecentProject],
        known: Capture | None = None,
    ) -> None:
        """Open a capture or project; see app.project.opening.opening.

        Args:
            current: Folder of the project that is open now.
            recent: Projects opened lately; those of the capture may be opened.
            known: The capture where it was opened already.
        """
        path, recent, project_dir, projects = Path(command.path), tuple(recent), self.project_dir, self.projects
        asked = command if isinstance(command, OpenCapture) else OpenCapture(path, choices=command.choices)
        self._newest = this = object()

        def work(context: JobContext) -> Opened | None:
            from app.importing.importable import is_importable  # with libraries that a window starts without

            if is_importable(path):
                return None
            return self._open_path(
                path,
                scale=asked.scale,
                project_dir=project_dir,
                current=current,
                context=context,
                recent=recent,
                is_new_project=asked.is_new_project,
                follow_links=asked.follow_links,
                is_asking=asked.is_asking,
                answers=asked.answers,
                known=known,
                choices=asked.choices,
                projects=projects,
            )

        def take(opened: Opened | None) -> None:
            if opened is None:
                if this is self._newest:
                    self._import(path, asked, current=current, recent=recent)
            elif this is self._newest:
                self._withdraw_refusals()
                self._take(opened)
            elif opened.project is not None or opened.is_asking:  # something else was asked for meanwhile
                opened.leave()

        def failed(error: Exception) -> None:
            if self._ask is not None and this is self._newest and self._ask(asked, error):
                return
            if asked.is_asking and self._refuse is not None and isinstance(error, CaptureError):
                if this is self._newest:
                    self._refuse(path, error)
                return
            notice = self._notices.add_failure(f"{printable(path.name or str(path))} cannot be opened", error)
            if isinstance(error, EngineError):
                self._refusals.append(notice)

        self._jobs.start("Opening", work, take, failed)

    def _import(self, path: Path, asked: OpenCapture, *, current: Path | None, recent: Sequence[RecentProject]) -> None:
        """Make a project of a scene of another program, unless there is one, and open it."""
        this, chosen, projects = self._newest, self.project_dir, self.projects

        def work(context: JobContext) -> Path:
            from app.importing.importable import imported_dir, project_of_scene

            return project_of_scene(path, imported_dir(path, projects) if chosen is None else chosen, context)

        def done(folder: Path) -> None:
            if this is self._newest:
                self.open(OpenProject(folder, asked.choices), current=current, recent=recent)

        def failed(error: Exception) -> None:
            self._refusals.append(self._notices.add_failure(f"{printable(path.name)} cannot be imported", error))

        self._jobs.start(f"Importing {printable(path.name)}", work, done, failed, can_cancel=True)

    def _withdraw_refusals(self) -> None:
        """Something is open now: earlier refusals no longer matter."""
        for notice in self._refusals:
            self._notices.withdraw(notice)
        self._refusals.clear()
