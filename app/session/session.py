"""Session: the one owner of live state, and the one thing a window talks to. `dispatch` takes commands, `poll` lets
finished work in. Belongs to one thread; nothing here blocks. Draws nothing.

It composes: `playback` prepares what is shown, `live_training` trains, `residuals` compares with what the cameras took,
`document` holds what is edited and the way back, `editing`, `marking` and `camera_paths` change parts of it, `recent`
what was opened before. What is open is one immutable value that each of them is handed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.background.jobs import Jobs
from app.background.log_reader import LogView
from app.background.usage import UsageMeter
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.playback.markers import Markers
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.bookmarks import Bookmarks
from app.playback.views.views import Views
from app.project.allowed_changes import check_change, discard_unfitting, is_other_cut
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.opening import Opened, open_for_window
from app.project.opening.opening_answers import answers_to_keep
from app.project.opening.project_access import check_settings
from app.project.opening.project_choices import AS_USUAL
from app.project.project import Project
from app.project.projects_folder import project_name, projects_dir
from app.residuals.residuals import Residuals
from app.session import commands
from app.session.captures.calibrating import Calibrating
from app.session.captures.capture_doctor import CaptureDoctor
from app.session.captures.capture_opening import CaptureOpening
from app.session.captures.synchronising import Synchronising
from app.session.clips.clip_commands import ClipCommand, CompareVersion
from app.session.clips.clip_work import ClipWork
from app.session.clips.comparing import show_version
from app.session.command_titles import SETTING_NAMES, TITLES
from app.session.copying.command_texts import CommandTexts
from app.session.edit_status import EditsStatus, HistoryStatus, PathsStatus
from app.session.editing.edit_reaches import EditReaches
from app.session.editing.edits import Edits
from app.session.editing.kept_document import KeptDocument
from app.session.editing.lost_edits import LostEdits
from app.session.editing.selecting import ProjectSelecting
from app.session.editing.selection_status import SelectionStatus
from app.session.editing.shown_to_select import ShownToSelect
from app.session.exclusions.excluding import apply_exclusion
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.exporting import Exporting
from app.session.files.file_commands import SaveProjectAs
from app.session.files.project_files import ProjectFiles
from app.session.marking import Marking
from app.session.mending.mend_commands import MendCommand
from app.session.mending.mending import ProjectMending
from app.session.notices import Notices
from app.session.paths.camera_paths import CameraPaths
from app.session.projects.project_opener import ProjectOpener
from app.session.projects.recent_projects import RecentProjects
from app.session.projects.setting_changes import changed_settings
from app.session.projects.settings import Settings
from app.session.projects.starting_over import StartingOver
from app.session.questions import LeaveQuestion, ProjectQuestion, Question
from app.session.recent_input import Attention
from app.session.session_face import SessionFace
from app.session.training.clip_versions import Versions
from app.session.training.follow_training import follow_training
from app.session.training.live_training import LiveTraining
from app.session.training.queue_commands import QueueCommands
from app.session.view_commands import LookCommand, look
from app.status import (
    ClipStatus,
    PlanStatus,
    ProjectStatus,
    QueueStatus,
    RegionsStatus,
    TrainingStatus,
    UsageStatus,
)
from app.training.messages import ENDINGS, TrainJob
from app.training.process import ProcessWorker, Worker
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.errors import EngineError


class Session(SessionFace):
    """Everything the program knows while it runs.

    Attributes:
        opened: What is open; None before.
        timeline, views, bookmarks: What the user looks at; the window may change them directly.
        training, queue, clip_states, plan, regions, paths, edits, history, usage, project_status: Status values,
            remade by `poll` and `dispatch`. The plan is that of the next clip; None while something trains or nothing
            is left to train.
        versions: What clips were before they were trained again.
        log: What program and training have said.
        question: What the user has to answer; None while there is nothing to ask.
        opening: What is asked about a capture that has no project yet.
        calibrating: Plain videos on their way to a capture.
        synchronising: How far the cameras of the open capture are ahead of each other.
        mending: A seam, or a stretch with flicker, that is mended.
        exporting: What leaves the project for other programs: what is asked, and the queue.
        recent: What was opened lately.
        files: Repairing, relocating and copying projects.
        doctor: What is wrong with the open capture, and what helps.
        command_texts: What was done, or could be, as commands to copy.
        notices: What the user has to know.

    Args:
        project_dir: Folder for the project of the next capture; one in the folder of projects when None.
        launch: Starts a training worker; a process by default.
        settings: Preferences; the user's own when None.
        opener: Opens captures; tests bring their own.
        is_preloading: Build a first cloud of a new capture, and load what draws right away. Loading takes a second or
            two and holds the window up a little, which nobody notices at the start but everybody would in the middle
            of a drag. Off in most tests.
    """

    def __init__(
        self,
        *,
        project_dir: Path | None = None,
        launch: Launch = ProcessWorker,
        settings: Settings | None = None,
        opener: Callable[..., Opened] = open_for_window,
        is_preloading: bool = True,
    ) -> None:
        self.opened: OpenedProject | None = None
        self.timeline, self.views = Timeline(), Views()
        self.bookmarks = Bookmarks()
        self.notices = Notices()
        self.question: Question | None = None
        self.training = TrainingStatus()
        self.clip_states: list[ClipStatus] = []
        self.plan: PlanStatus | None = None
        self.project_status: ProjectStatus | None = None
        self.queue = QueueStatus()
        self.usage = UsageStatus()
        self._launch, self._is_preloading, self._is_closed = launch, is_preloading, False
        self._jobs = Jobs(self._fail)
        self._settings = settings = Settings() if settings is None else settings
        self.opening = CaptureOpening(can_measure=is_preloading)
        self._is_new_asked, self._how_asked = False, AS_USUAL
        self._unopened: Opened | None = None
        """Opened, and held back until the user has agreed to stop the training."""
        self.calibrating, self.synchronising = Calibrating(), Synchronising()
        self.exporting = Exporting(self.notices, settings)
        self.live_training = LiveTraining(
            self._jobs,
            self.notices,
            launch=self._launch_worker,
            can_measure=is_preloading,
            live_view=settings.live_view,
        )
        self.versions = Versions(self._jobs, self.notices, lambda: self.live_training.service)
        self._queue_commands = QueueCommands(self.live_training, self.versions, self.notices, settings)
        self._usage, self.log = UsageMeter(), LogView()
        self.playback = Playback(self.live_training.state_of)
        self.residuals = Residuals(self.playback)
        self.document = KeptDocument(guard=self._check_change, on_change=self._follow_change)
        self.clip_work = ClipWork(self._jobs, self.notices, self.live_training, self.document, self._take_question)
        self.mending = ProjectMending(self.live_training, lambda: self.overlays)
        self.marking, self.camera_paths = Marking(self.document), CameraPaths(self.document)
        self.selecting = ProjectSelecting(
            ShownToSelect(self.playback, self.residuals, lambda: self.timeline, lambda: self._shown_as)
        )
        self.selection = SelectionStatus()
        self.editing = Edits(
            self.document,
            self.selecting,
            LostEdits(lambda: self.live_training.service),
            EditReaches(lambda: self.live_training.service),
        )
        self.command_texts = CommandTexts(lambda: self.project, self.live_training.is_finished)
        self.edits: EditsStatus = self.editing.status()
        self.regions: RegionsStatus = self.marking.status([])
        self.paths: PathsStatus = self.camera_paths.status()
        self.history = HistoryStatus()
        self.recent = RecentProjects(settings)
        self.opener = ProjectOpener(
            self._jobs,
            self.notices,
            self._take_opened,
            project_dir=project_dir,
            open_path=opener,
            refuse=self.opening.refuse,
            ask=lambda asked, error: self.files.ask_about(asked, error),
        )
        self.files = ProjectFiles(
            self._jobs, self.notices, ask=self._ask, open_project=self.dispatch, settle=self.document.settle
        )
        self.starting_over = StartingOver(
            self._jobs, self.notices, self.document, ask=self._ask, reopen=self._follow_settings
        )
        self.doctor = CaptureDoctor(self._jobs, self.notices, self.dispatch)
        self._attention = Attention()
        self._seen = self._news_key()
        self.recent.look()
        if is_preloading:  # while others import, starting a thread makes the window wait
            self.live_training.start()
            self.playback.start()

    # ---------------------------------------------------------------- commands

    def dispatch(self, command: commands.Command) -> None:
        """Carry out a command. What the user could have known better becomes a notice.

        Raises:
            TypeError: The object is not a command.
        """
        try:
            self._obey(command)
        except EngineError as error:
            self.notices.add_error(TITLES.get(type(command), "The command failed"), error)
        self._refresh()

    def _obey(self, command: commands.Command) -> None:
        live = self.live_training
        match command:
            case commands.OpenCapture() | commands.OpenProject():
                self.question = None
                current = None if self.project is None or not self.project.is_writable else self.project.folder
                if command.choices != AS_USUAL:  # it may be the open one, in another way
                    self.document.settle()
                known = self._take_answers(command) if isinstance(command, commands.OpenCapture) else None
                self.opener.open(command, current=current, recent=self.recent.entries, known=known)
            case _ if isinstance(command, commands.ProjectCommand):
                self._obey_about_project(command)
            case _ if isinstance(command, commands.FileCommand):
                self.question = None
                if isinstance(command, SaveProjectAs):  # what is written meanwhile would be half of it
                    self.clip_work.check_idle()
                    self.mending.check_idle()
                self.files.apply(command, self.project, is_training=live.is_busy)
            case commands.ForgetRecent(folder=folder):
                self.recent.forget(Path(folder))
            case commands.CloseQuestion():
                self.question = None
                self.opening.close_page()
                self.calibrating.close_page()
                self.synchronising.close_page()
                self.exporting.close_page()
            case commands.AskExport():
                self._ask_export()
            case _ if isinstance(command, commands.ExportCommand):
                self.exporting.apply(command)
            case commands.SynchroniseCameras():
                self.synchronising.measure(self.opened)
            case commands.ApplyOffsets(target=target):
                self.synchronising.apply(target)
            case commands.LookAtVideos(folder=folder):
                self.opening.close_page()
                self.calibrating.look(folder)
            case commands.CalibrateVideos(request=request):
                self.calibrating.start(request)
            case commands.KeepCalibration():
                self.calibrating.keep()
            case commands.StopCalibration():
                self.calibrating.stop()
            case commands.TrainNextClip():
                self.question = None
                live.train_next()
            case _ if isinstance(command, commands.QueueCommand):
                self.question = None
                self.question = self._queue_commands.obey(command)
            case _ if isinstance(command, MendCommand):
                self.mending.apply(command, self.timeline)
            case CompareVersion():
                show_version(command, self.timeline, self.overlays)
            case _ if isinstance(command, ClipCommand):
                self.question = None
                self.question = self.clip_work.obey(command)
            case _ if isinstance(command, ExclusionCommand):
                n_frames = 0 if self.capture is None else self.capture.n_frames
                apply_exclusion(command, self.document, self.rig.names, n_frames)
            case commands.PauseTraining():
                live.pause()
            case commands.ResumeTraining():
                live.resume()
            case commands.StopTraining():
                live.stop()
            case _ if isinstance(command, LookCommand):
                look(command, self.timeline, self.views, self.playback)
            case commands.SetHoldout() | commands.SetClipLength() | commands.SetTrainSetting() | commands.SetPreset():
                self._change_settings(command)
            case commands.CancelJob(name=name):
                self._jobs.give_up(name)
            case commands.DismissNotice(index=index):
                self.notices.dismiss(index)
            case commands.ExamineCapture():
                self.doctor.examine()
            case commands.StopExamining():
                self.doctor.stop()
            case commands.CorrectCapture(corrections=corrections, words=words, is_confirmed=is_confirmed):
                self.question = None if is_confirmed else self.doctor.question(corrections, words)
                if is_confirmed:
                    self.doctor.correct(corrections)
            case _ if isinstance(command, commands.MarkCommand):
                self.marking.apply(command)
            case _ if isinstance(command, commands.SelectionCommand):
                self.selecting.apply(command)
            case _ if isinstance(command, commands.PathCommand):
                self.camera_paths.apply(command, self.views, self.timeline)
            case _ if isinstance(command, commands.EditCommand):
                self.editing.apply(command)
            case commands.Undo() | commands.Redo() | commands.GoToStep():
                with self.camera_paths.showing_change():
                    self.editing.go(_n_steps(command))
            case _:
                raise TypeError(f"not a command: {command!r}")

    def _obey_about_project(self, command: commands.ProjectCommand) -> None:
        asked, self.question = self.question, None
        match command:
            case commands.SetProjectsFolder(folder=folder):
                self.question = asked
                self.opener.projects = projects_dir(folder)
            case commands.LeaveTraining():
                found, self._unopened = self._unopened, None
                if found is not None:
                    self._enter(found)
            case _ if self.opened is None:
                self.live_training.tell_nothing_open()
            case commands.NewProject():
                capture = self.opened.capture
                self._obey(
                    commands.OpenCapture(
                        capture.path, is_new_project=True, is_asking=True, follow_links=capture.follow_links
                    )
                )
            case commands.AskStartOver():
                self._check_idle()
                self.starting_over.ask(self.opened)
            case commands.StartOver(preset=preset):
                self._check_idle()
                self.starting_over.start(self.opened, preset, asked)

    def _check_idle(self) -> None:
        """See that nothing works on clips. Raises ProjectError."""
        self.live_training.check_idle()
        self.clip_work.check_idle()
        self.mending.check_idle()

    def _ask(self, question: Question | None) -> None:
        self.question = question

    def _ask_export(self) -> None:
        service = self.live_training.service
        catalog = () if service is None else service.catalog
        trained = tuple(i for i in range(len(catalog)) if catalog[i].state == "trained")
        names = tuple(path.name for path in self.paths.paths)
        self.exporting.ask(self.opened, self.timeline, trained, names, settle=self.document.settle)

    def _change_settings(self, command: commands.SettingCommand) -> None:
        """Replace settings that every clip shares."""
        opened = self.opened
        if opened is None:
            return
        changed = changed_settings(opened.project.settings, command, opened.rig)
        check_settings(changed, opened.capture)
        name = SETTING_NAMES.get(type(command), "change settings")
        self.document.change(replace(opened.project.document, settings=changed), name)

    def _take_question(self, question: Question) -> None:
        if self.question is None:  # what is asked already comes first
            self.question = question

    def _check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """See that no clip is finished with settings that change. Raises ProjectError."""
        opened = self.opened
        if opened is None:
            return
        if is_other_cut(before.settings, after.settings):
            self._check_idle()
        check_change(opened.project, opened.capture, before, after, is_training=self.live_training.is_busy)

    def _follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """The document has changed: show what follows from it."""
        if before.settings != after.settings:
            self._discard_unfitting(before.settings, after.settings)
            self._follow_settings()
        elif before.exclusions != after.exclusions and self.opened is not None:
            if self.live_training.service is not None:
                self.live_training.service.catalog.judge_anew()
            self._open_residuals(self.opened)
        self._show_notes(after)

    def _discard_unfitting(self, before: ProjectSettings, after: ProjectSettings) -> None:
        assert self.opened is not None
        found = discard_unfitting(self.opened.project, before, after)
        if found.progress:
            words = found.progress_words
            self.notices.add("info", "Settings changed", f"{words[0].upper()}{words[1:]} was discarded.")

    def _show_notes(self, document: ProjectDocument) -> None:
        """Let the timeline show the document's markers, and views stand upright as it says."""
        self.timeline.markers = Markers(document.markers)
        self.views.set_scene_up(document.world.up)

    def _follow_settings(self) -> None:
        opened = self.opened
        assert opened is not None
        before = self.timeline
        changed_project = opened_project(opened.capture, opened.project, opened.generation)
        self._show(changed_project)
        self.live_training.open(changed_project)
        self.versions.open(changed_project)
        self.clip_work.open(changed_project)
        self.mending.open(changed_project)
        self._open_residuals(changed_project)
        self.timeline.take_over(before)

    # ---------------------------------------------------------------- opening

    def _take_answers(self, command: commands.OpenCapture) -> Capture | None:
        """The user has answered, or asks for something else. The capture where it is open already."""
        known = None if command.answers is None else self.opening.take(Path(command.path))
        if known is not None and command.answers is not None:
            self._settings.set_last_answers(answers_to_keep(command.answers, known))
        self._is_new_asked, self._how_asked = command.is_new_project, command.choices
        self.opening.close_page()
        self.calibrating.close_page()
        self.synchronising.close_page()
        self.exporting.close_page()
        return known

    def _take_opened(self, found: Opened) -> None:
        if found.is_asking:
            self.opening.ask(
                found.capture,
                self._settings.last_answers,
                is_new_project=self._is_new_asked,
                folder=found.folder or Path(),
            )
            return
        if found.choices:
            opened = None if self.project is None else self.project.folder.resolve()
            self.question = ProjectQuestion(
                str(found.capture.path), found.choices, found.follow_links, opened, self._how_asked
            )
            return
        if found.project is None:  # it is open already
            self.view.home()
            return
        if self.live_training.is_busy:
            self._unopened = found
            status = self.live_training.status(None)
            name = project_name(found.project.folder.absolute(), found.project.settings.capture)
            self.question = LeaveQuestion(name, status.clip_index or 0, status.step, status.n_steps, len(status.queue))
            return
        self._enter(found)

    def _enter(self, found: Opened) -> None:
        """Go to a project that was opened; the one that was open is left."""
        assert found.project is not None
        self._keep_recent()  # the one that is left
        generation = 1 if self.opened is None else self.opened.generation + 1
        opened = opened_project(found.capture, found.project, generation)
        self.document.open(found.project)  # first: it keeps what was edited in the project that is left
        self.camera_paths.leave()
        self.selecting.open()
        self._show(opened)
        self.live_training.open(opened, found.catalog)
        self.versions.open(opened)
        self.clip_work.open(opened)
        self.mending.open(opened)
        self.exporting.open(opened)
        self._open_residuals(opened)
        self.doctor.open(opened)
        self.views.look_at(opened.rig)
        self._show_notes(opened.project.document)
        self.bookmarks = Bookmarks()
        self._keep_recent()
        for sentence in opened.capture.warnings:
            self.notices.add("warn", "The capture is usable, with warnings", sentence)
        for note in found.notes:
            self.notices.add(*note)
        if self._is_preloading:
            self.playback.build_first_cloud(self._jobs)

    def _show(self, opened: OpenedProject) -> None:
        self.opened = opened
        self.timeline = Timeline(opened.clips, fps=opened.capture.fps)
        self.playback.show(opened)

    def _open_residuals(self, opened: OpenedProject) -> None:
        if self.live_training.service is not None:
            self.residuals.open(opened, self.live_training.service.catalog)

    def _keep_recent(self) -> None:
        if self.opened is not None and self.live_training.service is not None:
            self.recent.keep(self.opened, self.live_training.service.catalog)
            if self._is_preloading:
                self.recent.pictures.keep(self.opened, self.playback.frame(self.timeline), self.view)

    def _fail(self, job_name: str, error: Exception) -> None:
        self.notices.add_failure(f"{job_name} has failed", error)

    def _launch_worker(self, job: TrainJob, project: Project) -> Worker:
        self.document.settle()  # a region marked a moment ago is meant to count
        return self._launch(job, project)

    # ---------------------------------------------------------------- letting finished work in

    def poll(self) -> bool:
        """Take in what threads and workers finished. Whether something visible changed."""
        has_changed = self._jobs.poll()
        self.recent.poll()
        has_changed |= self.opening.poll() | self.calibrating.poll() | self.synchronising.poll()
        has_changed |= self.mending.poll()
        events = self.live_training.poll()
        if any(isinstance(event, ENDINGS) for event in events):
            self._keep_recent()
        self._release_snapshot()
        has_changed |= bool(events) | self.document.poll() | self.selecting.poll()
        has_changed |= self.lead_view()
        is_training = self.live_training.is_busy and self.training.state != "paused"
        has_changed |= self.exporting.poll(is_training=is_training)
        is_attended = self._attention.follow((self.view.look_key, self.timeline.frame_index))
        if self._is_preloading:
            self.residuals.look_at(self.timeline, self.view.look_through)
        has_changed |= self.residuals.poll(is_busy=is_training or is_attended)
        self._tell_failures()
        self.clip_work.look_for_damage()
        self.playback.work_ahead(self.timeline, is_busy=self.live_training.is_busy)
        rig = self.playback.rig(self.timeline)
        if rig is not None and rig is not self.view.rig:  # a view that looks through a camera follows it
            self.views.correct(rig)
            has_changed = True
        seen = self._news_key()
        has_changed |= seen != self._seen
        self._seen = seen
        if has_changed:
            self._refresh()
        return has_changed

    def _news_key(self) -> tuple[object, ...]:
        """Differs whenever a thread has finished something, or there is something else to tell."""
        jobs = tuple((job.name, job.done, job.message) for job in self.jobs)
        seen = (self.versions.worker.newest, self.log.worker.newest)
        looked = tuple(None if found is None else found[0] for found in seen)
        finished = self.playback.finished, self.live_training.finished, self.recent.pictures.revision
        return (
            *finished,
            *self.opening.finished,
            *self.calibrating.finished,
            *self.synchronising.finished,
            *self.exporting.finished,
            *self.mending.finished,
            self.selecting.finished,
            looked,
            self.clip_work.finished,
            jobs,
            self.notices.revision,
            self.recent.missing,
            self.doctor.finished,
        )

    def _release_snapshot(self) -> None:
        """Give a snapshot back once it was read, or where nobody looks at its clip."""
        if not self.live_training.unread_clips:
            return
        clip = self.timeline.clip
        is_read = clip is None or self.playback.is_loaded(self.timeline)
        self.live_training.give_back_snapshots(but=None if is_read or clip is None else clip.clip_index)

    def _tell_failures(self) -> None:
        told = []
        for failure in [*self.playback.take_failures(), *self.residuals.take_failures()]:
            if failure.is_live:
                self.live_training.replace_snapshot(failure.error)
                continue
            if failure.is_of_clip:
                self.live_training.note_damage(failure.error)
            told.append((failure.title, failure.error))
        unselected = self.selecting.take_error()
        if unselected is not None:
            told.append(("The selection cannot be made", unselected))
        unkept = self.document.take_error()
        if unkept is not None:
            told.append(("Edits could not be read or saved", unkept))
        for title, error in told:
            if not self.notices.has_told(error):
                self.notices.add_failure(title, error)

    def _refresh(self) -> None:
        """Remake the status values."""
        if self._unopened is not None and not isinstance(self.question, LeaveQuestion):  # the user stays
            self._unopened.leave()
            self._unopened = None
        follow_training(self.timeline, self.live_training)
        live, clip, opened = self.live_training, self.timeline.clip, self.opened
        if clip is not None:
            live.note_anchors(clip.clip_index, self.playback.live_anchors(self.timeline))
        self.training = live.status(None if clip is None else clip.clip_index)
        self.clip_states = live.clip_states()
        self.regions = self.marking.status(self.clip_states)
        self.lead_view()
        self.paths, self.history = self.camera_paths.status(), self.document.status()
        self.edits = self.editing.status()
        self.selection = self.selecting.status()
        self.plan, self.queue = live.plan(), live.queue()
        self.usage = self._usage.sample(() if live.service is None else live.service.worker_pids)
        if opened is not None:
            n_trained = 0 if live.service is None else live.service.catalog.n_trained
            name = project_name(opened.project.folder.absolute(), opened.project.settings.capture)
            self.project_status = ProjectStatus(
                name, opened.project.folder, n_trained, len(opened.clips), opened.project.is_writable
            )

    def lead_view(self) -> bool:
        """Let the view go along the camera path, where that is wanted, after the playhead has moved. Whether anything
        changed."""
        has_changed = self.camera_paths.lead(self.views, self.timeline)
        if has_changed:
            self.paths = self.camera_paths.status()
        return has_changed

    def wake_by(self, wake: Callable[[], None]) -> None:
        """Call this, on some thread, when a frame or picture that was asked for is there; it must not block."""
        self.playback.renderer.on_picture = self.playback.decoder.on_frame = self.selecting.on_found = wake

    def close(self) -> None:
        """End workers and threads, keeping progress. Blocks for a few seconds at most. May be called twice."""
        if self._is_closed:
            return
        self._is_closed = True
        if self._unopened is not None:
            self._unopened.leave()
        self.document.close()
        self.selecting.close()
        self.live_training.close()
        self._keep_recent()
        self._jobs.close(timeout_s=6.0 if self.live_training.is_ending else 1.0)
        self.mending.close()  # both may write into the project, whose lock goes now
        if self.project is not None:
            self.project.close()
        self.recent.close()
        self.opening.close()
        self.calibrating.close()
        self.synchronising.close()
        self.exporting.close()
        self.residuals.close()
        self.doctor.close()
        self.playback.close()
        self.versions.close()
        self.clip_work.close()
        self.log.close()
        if self.capture is not None:
            self.capture.close()


def _n_steps(command: commands.Undo | commands.Redo | commands.GoToStep) -> int:
    if isinstance(command, commands.GoToStep):
        return command.n_steps
    return -1 if isinstance(command, commands.Undo) else 1
