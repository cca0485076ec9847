"""Projects: which project is open, how others are opened and left, and the effects of changed settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.background.jobs import Jobs
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.project.allowed_changes import discard_unfitting
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.opening import Opened
from app.project.opening.opening_answers import answers_to_keep
from app.project.opening.project_access import check_settings
from app.project.opening.project_choices import AS_USUAL
from app.project.project import Project
from app.project.projects_folder import project_name, projects_dir
from app.session.captures.capture_opening import CaptureOpening
from app.session.command_titles import SETTING_NAMES
from app.session.editing.kept_document import KeptDocument
from app.session.files.file_commands import FileCommand, SaveProjectAs
from app.session.files.project_files import ProjectFiles
from app.session.notices import Notices
from app.session.part import SessionPart, SessionParts
from app.session.projects.project_commands import (
    AskStartOver,
    ForgetRecent,
    LeaveTraining,
    NewProject,
    OpenCapture,
    OpenCommand,
    OpenProject,
    ProjectCommand,
    SetProjectsFolder,
    StartOver,
)
from app.session.projects.project_opener import ProjectOpener
from app.session.projects.recent_projects import RecentProjects
from app.session.projects.setting_changes import changed_settings
from app.session.projects.setting_commands import SettingCommand
from app.session.projects.settings import Settings
from app.session.projects.starting_over import StartingOver
from app.session.questions import Asked, LeaveQuestion, ProjectQuestion
from app.session.showing.showing import Showing
from app.session.training.live_training import LiveTraining
from app.status import ProjectStatus
from engine.capture.capture import Capture
from engine.capture.formats.imported import finished_word
from engine.errors import EngineError


class Projects(SessionPart):
    """For one thread, and nothing here waits.

    Attributes:
        opened: The open project; None before.
        recent: Projects opened lately.

    Args:
        parts: Of the session; each is handed the open project.
        jobs, notices, asked, settings, document, live, showing, opening: Of the session.
        project_dir: Folder for the project of the next capture; one in the folder of projects when None.
        open_path: Opens captures, on a thread.
        is_preloading: Whether small pictures of projects are made.
    """

    def __init__(
        self,
        parts: SessionParts,
        jobs: Jobs,
        notices: Notices,
        asked: Asked,
        *,
        settings: Settings,
        document: KeptDocument,
        live: LiveTraining,
        showing: Showing,
        opening: CaptureOpening,
        project_dir: Path | None,
        open_path: Callable[..., Opened],
        is_preloading: bool,
    ) -> None:
        self.opened: OpenedProject | None = None
        self.recent = RecentProjects(settings)
        self._parts, self._notices, self._asked = parts, notices, asked
        self._settings, self._document, self._live = settings, document, live
        self._showing, self._opening, self._is_preloading = showing, opening, is_preloading
        self._is_new_asked, self._how_asked = False, AS_USUAL
        self._unopened: Opened | None = None
        """Opened, and held back until the user has agreed to stop the training."""
        self._n_ended = live.n_ended
        self._files = ProjectFiles(jobs, notices, ask=asked.put, open_project=self._open, settle=document.settle)
        self.opener = ProjectOpener(
            jobs,
            notices,
            self._take_opened,
            project_dir=project_dir,
            open_path=open_path,
            refuse=opening.refuse,
            ask=self._files.ask_about,
        )
        self._starting_over = StartingOver(jobs, notices, document, ask=asked.put, reopen=self._reopen)

    @property
    def project(self) -> Project | None:
        """The project that is open."""
        return None if self.opened is None else self.opened.project

    # ---------------------------------------------------------------- commands

    def obey(self, command: ProjectCommand) -> None:
        """Carry out a command.

        Raises:
            EngineError: It cannot be done; states the cause.
        """
        if isinstance(command, ForgetRecent):
            self.recent.forget(Path(command.folder))
            return
        if isinstance(command, SetProjectsFolder):
            self.opener.projects = projects_dir(command.folder)
            return
        question = self._asked.take()
        match command:
            case OpenCapture() | OpenProject():
                self._open(command)
            case LeaveTraining():
                found, self._unopened = self._unopened, None
                if found is not None:
                    self._enter(found)
            case _ if self.opened is None:
                self._live.tell_nothing_open()
            case NewProject():
                path, follow_links = self.opened.capture.path, self.opened.capture.follow_links
                self._open(OpenCapture(path, is_new_project=True, is_asking=True, follow_links=follow_links))
            case AskStartOver() | StartOver():
                self._live.check_not_training()
                self._parts.check_idle()
                if isinstance(command, AskStartOver):
                    self._starting_over.ask(self.opened)
                else:
                    self._starting_over.start(self.opened, command.preset, question)

    def obey_about_files(self, command: FileCommand) -> None:
        """Carry out a command on the files of the project.

        Raises:
            ProjectError: It cannot be done; states the cause.
        """
        self._asked.put(None)
        if isinstance(command, SaveProjectAs):  # the copy would hold half-written files
            self._parts.check_idle()
        self._files.apply(command, self.project, is_training=self._live.is_busy_anywhere)

    def change_settings(self, command: SettingCommand) -> None:
        """Replace settings that every clip shares.

        Raises:
            EngineError: They cannot be so.
        """
        opened = self.opened
        if opened is None:
            return
        changed = changed_settings(opened.project.settings, command, opened.rig)
        check_settings(changed, opened.capture)
        name = SETTING_NAMES.get(type(command), "change settings")
        self._document.change(replace(opened.project.document, settings=changed), name)

    def follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """With other settings, progress may not fit; all parts take up the project anew."""
        if before.settings == after.settings or self.opened is None:
            return
        if before.settings.is_placed_as(after.settings):
            self._grow(after.settings)
            return
        found = discard_unfitting(self.opened.project, before.settings, after.settings)
        if found.progress:
            words = found.progress_words
            self._notices.add("info", "Settings changed", f"{words[0].upper()}{words[1:]} was discarded.")
        self._reopen()

    def take_capture(self, capture: Capture, settings: ProjectSettings, name: str) -> None:
        """The capture of the open project was read in another way, to which settings belong.

        Args:
            name: Of the step.
        Raises:
            ProjectError: Settings cannot change now; everything is as it was.
        """
        assert self.opened is not None
        before, self.opened = self.opened, replace(self.opened, capture=capture)
        try:
            self._document.change(replace(before.project.document, settings=settings), name)
        except EngineError:
            self.opened = before
            capture.close()
            raise
        before.capture.close()

    def _grow(self, settings: ProjectSettings) -> None:
        """All parts take up the frames that were recorded since."""
        opened = self.opened
        assert opened is not None
        if settings.frames is None or settings.frames == opened.capture.frames:
            return
        capture = opened.capture.grown(settings.frames[1] - settings.frames[0])
        self.opened = opened_project(capture, opened.project, opened.generation)
        self._parts.grow(self.opened)
        opened.capture.close()

    def _reopen(self) -> None:
        assert self.opened is not None
        self.opened = opened_project(self.opened.capture, self.opened.project, self.opened.generation)
        self._parts.reopen(self.opened)

    # ---------------------------------------------------------------- opening

    def _open(self, command: OpenCommand) -> None:
        current = None if self.project is None or not self.project.is_writable else self.project.folder
        if command.choices != AS_USUAL:  # it may be the open one, in another way
            self._document.settle()
        known = self._take_answers(command) if isinstance(command, OpenCapture) else None
        self.opener.open(command, current=current, recent=self.recent.entries, known=known)

    def _take_answers(self, command: OpenCapture) -> Capture | None:
        """The user has answered, or asks for something else. The capture where it is open already."""
        known = None if command.answers is None else self._opening.take(Path(command.path))
        if known is not None and command.answers is not None:
            self._settings.set_last_answers(answers_to_keep(command.answers, known))
        self._is_new_asked, self._how_asked = command.is_new_project, command.choices
        self._parts.close_page()
        return known

    def _take_opened(self, found: Opened) -> None:
        if found.is_asking:
            answers, folder = self._settings.last_answers, found.folder or Path()
            self._opening.ask(found.capture, answers, is_new_project=self._is_new_asked, folder=folder)
        elif found.choices:
            opened = None if self.project is None else self.project.folder.resolve()
            path = str(found.capture.path)
            self._asked.put(ProjectQuestion(path, found.choices, found.follow_links, opened, self._how_asked))
        elif found.project is None:  # it is open already
            self._showing.view.home()
        elif self._live.is_busy:
            self._unopened = found
            status = self._live.status(None)
            name = project_name(found.project.folder.absolute(), found.project.settings.capture)
            n_waiting = len(status.queue)
            self._asked.put(
                LeaveQuestion(
                    name, status.clip_index or 0, status.step, status.n_steps, n_waiting, status.n_running - 1
                )
            )
        else:
            self._enter(found)

    def stay(self) -> None:
        """Close the project held back, where the user has not agreed to leave the open one."""
        if self._unopened is not None and not isinstance(self._asked.question, LeaveQuestion):
            self._unopened.leave()
            self._unopened = None

    def _enter(self, found: Opened) -> None:
        """Go to a project that was opened; the one that was open is left."""
        assert found.project is not None
        self._keep_recent()  # the one that is left
        generation = 1 if self.opened is None else self.opened.generation + 1
        self.opened = opened_project(found.capture, found.project, generation)
        self._live.take_catalog(found.catalog)
        self._parts.open(self.opened)
        self._keep_recent()
        for sentence in found.capture.warnings:
            self._notices.add("warn", "The capture is usable, with warnings", sentence)
        for note in found.notes:
            self._notices.add(*note)

    # ---------------------------------------------------------------- recent projects

    def _keep_recent(self) -> None:
        if self.opened is not None and self._live.service is not None:
            self.recent.keep(self.opened, self._live.service.catalog)
            if self._is_preloading:
                shown = self._showing.playback.frame(self._showing.timeline)
                self.recent.pictures.keep(self.opened, shown, self._showing.view)

    def status(self) -> ProjectStatus | None:
        """The open project; None before there is one."""
        if self.opened is None:
            return None
        project, service = self.opened.project, self._live.service
        n_trained = 0 if service is None else service.catalog.n_trained
        name = project_name(project.folder.absolute(), project.settings.capture)
        word = finished_word(has_pictures=self.opened.capture.has_pictures)
        return ProjectStatus(name, project.folder, n_trained, len(self.opened.clips), project.is_writable, word)

    def poll(self) -> bool:
        """Take in the state of recent projects, and keep how far the open one is trained."""
        self.recent.poll()
        if self._live.n_ended != self._n_ended:
            self._n_ended = self._live.n_ended
            self._keep_recent()
        return False

    @property
    def finished(self) -> object:
        """Differs when recent projects were looked up."""
        return self.recent.pictures.revision, self.recent.missing

    def close(self) -> None:
        """Keep the open project among the recent ones. Its files stay locked until everything is closed."""
        if self._unopened is not None:
            self._unopened.leave()
        self._keep_recent()
        self.recent.close()
