"""Session: the one owner of live state, and the one thing a window talks to. `dispatch` takes commands, `poll` lets
finished work in. Belongs to one thread; nothing here blocks. Draws nothing.

It is composed of parts (see part.py), each of which carries out its own commands: a part is made and added here, once,
and its commands have a line in `_obey`. The open project is one immutable value that each part is handed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.background.jobs import Jobs
from app.background.log_reader import LogView
from app.background.usage import UsageMeter
from app.document.changes.timing_changes import TimeEdit
from app.project.opening.opening import Opened, open_for_window
from app.session.captures.calibrating import Calibrating
from app.session.captures.capture_commands import (
    CalibrationCommand,
    CorrectCapture,
    DoctorCommand,
    FollowRecording,
    LookAtVideos,
    SynchronisationCommand,
)
from app.session.captures.capture_doctor import CaptureDoctor
from app.session.captures.capture_opening import CaptureOpening
from app.session.captures.recording_follower import RecordingFollower
from app.session.captures.synchronising import Synchronising
from app.session.clips.clip_commands import ClipCommand
from app.session.clips.clip_work import ClipWork
from app.session.command_titles import TITLES
from app.session.commands import CancelJob, CloseQuestion, Command, DismissNotice
from app.session.copying.command_texts import CommandTexts
from app.session.edit_status import EditsStatus, HistoryStatus, PathsStatus
from app.session.editing.edit_commands import EditCommand, FillBehind, HistoryCommand
from app.session.editing.edit_reaches import EditReaches
from app.session.editing.edits import Edits
from app.session.editing.kept_document import KeptDocument
from app.session.editing.lost_edits import LostEdits
from app.session.editing.mark_commands import MarkCommand
from app.session.editing.selecting import ProjectSelecting
from app.session.editing.selection_commands import SelectionCommand
from app.session.editing.selection_status import SelectionStatus
from app.session.editing.shown_to_select import ShownToSelect
from app.session.exclusions.excluding import apply_exclusion
from app.session.exclusions.exclusion_commands import ExclusionCommand
from app.session.export_commands import AskExport, ExportCommand
from app.session.exporting import Exporting
from app.session.files.file_commands import FileCommand
from app.session.filling import Filling
from app.session.marking import Marking
from app.session.mending.mend_commands import MendCommand
from app.session.mending.mending import ProjectMending
from app.session.notices import Notices
from app.session.objects.follow_commands import FollowCommand
from app.session.objects.following import Following
from app.session.objects.object_commands import ObjectCommand
from app.session.objects.objects import Objects
from app.session.part import SessionParts
from app.session.paths.camera_paths import CameraPaths
from app.session.paths.path_commands import PathCommand
from app.session.projects.project_commands import ProjectCommand
from app.session.projects.projects import Projects
from app.session.projects.setting_commands import SettingCommand
from app.session.projects.settings import Settings
from app.session.questions import Asked
from app.session.session_face import SessionFace
from app.session.showing.look_commands import CompareProject, LookCommand
from app.session.showing.other_project import OtherProject
from app.session.showing.showing import Showing
from app.session.timing.time_edits import apply_time_edit
from app.session.training.clip_versions import Versions
from app.session.training.cluster_joining import ClusterJoining, Connect
from app.session.training.live_training import LiveTraining
from app.session.training.train_commands import ClusterCommand, HoldCommand, TrainCommand
from app.session.training.training_verbs import TrainingVerbs
from app.status import ClipStatus, PlanStatus, ProjectStatus, QueueStatus, RegionsStatus, TrainingStatus, UsageStatus
from app.training.process import ProcessWorker
from app.training.service import Launch
from engine.errors import EngineError


class Session(SessionFace):
    """Everything the program knows while it runs.

    Attributes:
        training, queue, clip_states, plan, regions, paths, edits, selection, history, usage, project_status: Status
            values, remade by `poll` and `dispatch`. The plan is that of the next clip; None while something trains or
            nothing is left to train.
        projects: The open project, and those opened lately.
        showing: The shown picture, and everything that prepares it.
        other: A second project to compare with.
        live_training, versions: The training, and earlier versions of clips.
        joining: The cluster that clips train on, if any.
        document: The edited document, and the way back.
        log: Lines of program and training.
        opening: The questions about a capture that has no project yet.
        calibrating: Plain videos on their way to a capture.
        synchronising: How far the cameras of the open capture are ahead of each other.
        mending: A seam, or a stretch with flicker, that is mended.
        exporting: The export dialog, and the queue of exports.
        doctor: Faults of the open capture, and remedies.
        command_texts: Steps, done or possible, as commands to copy.
        notices: Messages to the user.

    Args:
        project_dir: Folder for the project of the next capture; one in the folder of projects when None.
        launch: Starts a training worker; a process by default.
        connect: Joins a cluster; None where the program cannot.
        settings: Preferences; the user's own when None.
        opener: Opens captures; tests bring their own.
        is_preloading: Build a first cloud of a new capture, and load the drawing code at once. Loading takes a second
            or two and holds the window up a little, unnoticed at the start but not in the middle of a drag. Off in
            most tests.
    """

    def __init__(
        self,
        *,
        project_dir: Path | None = None,
        launch: Launch = ProcessWorker,
        connect: Connect | None = None,
        settings: Settings | None = None,
        opener: Callable[..., Opened] = open_for_window,
        is_preloading: bool = True,
    ) -> None:
        self._is_closed = False
        self.training, self.queue = TrainingStatus(), QueueStatus()
        self.clip_states: list[ClipStatus] = []
        self.plan: PlanStatus | None = None
        self.usage, self._usage = UsageStatus(), UsageMeter()
        self.notices, self.asked, self.log = Notices(), Asked(), LogView()
        self._jobs = jobs = Jobs(self._fail)
        settings = Settings() if settings is None else settings

        # Parts are opened, polled and closed in this order: edits are kept first, and a part comes after those
        # that it reads.
        self._parts = parts = SessionParts()
        self.document = parts.add(KeptDocument(guard=parts.check_change, on_change=parts.follow_change))
        self.live_training = live = parts.add(
            LiveTraining(
                jobs,
                self.notices,
                launch=launch,
                settle=self.document.settle,
                can_measure=is_preloading,
                live_view=settings.live_view,
            )
        )
        self.showing = showing = Showing(live, jobs, is_training=self._is_training, is_preloading=is_preloading)
        self.opening = CaptureOpening(can_measure=is_preloading)
        self.projects = parts.add(  # before the parts that it shows: other settings make them anew
            Projects(
                parts,
                jobs,
                self.notices,
                self.asked,
                settings=settings,
                document=self.document,
                live=live,
                showing=showing,
                opening=self.opening,
                project_dir=project_dir,
                open_path=opener,
                is_preloading=is_preloading,
            )
        )
        parts.add(showing)
        self.other = parts.add(OtherProject(jobs, self.notices, showing, lambda: self.projects.opener.projects))
        self.selecting = parts.add(ProjectSelecting(ShownToSelect(showing)))
        self.camera_paths = parts.add(CameraPaths(self.document))
        self.joining = parts.add(ClusterJoining(connect, live, jobs, self.notices))
        self.versions = parts.add(Versions(jobs, self.notices, lambda: live.service))
        self.clip_work = parts.add(ClipWork(jobs, self.notices, live, self.document, self.asked.put_if_free))
        self.mending = parts.add(ProjectMending(live, lambda: self.overlays))
        parts.add(self.opening)
        self.calibrating, self.synchronising = parts.add(Calibrating()), parts.add(Synchronising())
        self.exporting = parts.add(Exporting(self.notices, settings, is_training=self._is_training))
        self.doctor = parts.add(CaptureDoctor(jobs, self.notices, self.dispatch))

        self._verbs = TrainingVerbs(live, self.versions, self.notices, settings)
        self.marking = Marking(self.document)
        lost, reaches = LostEdits(lambda: live.service), EditReaches(lambda: live.service)
        self.editing = Edits(self.document, self.selecting, lost, reaches)
        self.objects = parts.add(
            Objects(
                self.document,
                self.selecting,
                lambda: self.timeline,
                reaches,
                jobs,
                self.notices,
                is_training=self._is_training,
            )
        )
        self.following = parts.add(Following(self.document, jobs, self.notices))
        self.command_texts = CommandTexts(
            lambda: self.project, live.is_finished, lambda: None if self.capture is None else self.capture.n_frames
        )
        self.filling = parts.add(Filling(self.document, jobs, self.notices))
        self.recording = parts.add(
            RecordingFollower(self.document, jobs, self.notices, live, take_capture=self.projects.take_capture)
        )
        self.project_status: ProjectStatus | None = None
        self.selection = SelectionStatus()
        self.edits: EditsStatus = self.editing.status()
        self.regions: RegionsStatus = self.marking.status([])
        self.paths: PathsStatus = self.camera_paths.status()
        self.history = HistoryStatus()
        self._seen = self._news_key()
        self.recent.look()
        if is_preloading:  # while others import, starting a thread makes the window wait
            live.start()
            self.playback.start()

    # ---------------------------------------------------------------- commands

    def dispatch(self, command: Command) -> None:
        """Carry out a command. One that is refused becomes a notice.

        Raises:
            TypeError: The object is not a command.
        """
        try:
            self._obey(command)
        except EngineError as error:
            self.notices.add_error(TITLES.get(type(command), "The command failed"), error)
        self._refresh()

    def _obey(self, command: Command) -> None:
        match command:
            case _ if isinstance(command, ProjectCommand):
                self.projects.obey(command)
            case _ if isinstance(command, FileCommand):
                self.projects.obey_about_files(command)
            case _ if isinstance(command, SettingCommand):
                self.projects.change_settings(command)
            case _ if isinstance(command, TrainCommand):
                self.asked.put(None)
                self.asked.put(self._verbs.obey(command))
            case _ if isinstance(command, HoldCommand):
                self._verbs.obey(command)
            case _ if isinstance(command, ClusterCommand):
                self.joining.obey(command)
            case _ if isinstance(command, ClipCommand):
                self.asked.put(None)
                self.asked.put(self.clip_work.obey(command))
            case _ if isinstance(command, LookCommand):
                self.showing.obey(command)
            case CompareProject():
                self.other.choose(command)
            case _ if isinstance(command, EditCommand):
                self.editing.apply(command)
            case FillBehind():
                self.filling.apply(command)
            case _ if isinstance(command, ObjectCommand):
                self.objects.apply(command)
            case _ if isinstance(command, FollowCommand):
                self.following.apply(command)
            case _ if isinstance(command, HistoryCommand):
                with self.camera_paths.showing_change():
                    self.editing.go(command.n_steps)
            case _ if isinstance(command, SelectionCommand):
                self.selecting.apply(command)
            case _ if isinstance(command, MarkCommand):
                self.marking.apply(command)
            case _ if isinstance(command, PathCommand):
                self.camera_paths.apply(command, self.views, self.timeline)
            case _ if isinstance(command, TimeEdit):
                apply_time_edit(command, self.document, 0 if self.capture is None else self.capture.n_frames)
            case _ if isinstance(command, ExclusionCommand):
                n_frames = 0 if self.capture is None else self.capture.n_frames
                apply_exclusion(command, self.document, self.rig.names, n_frames)
            case _ if isinstance(command, MendCommand):
                self.mending.apply(command, self.timeline)
            case AskExport():
                self._ask_export()
            case _ if isinstance(command, ExportCommand):
                self.exporting.apply(command)
            case CorrectCapture():
                self.asked.put(self.doctor.obey(command))
            case _ if isinstance(command, DoctorCommand):
                self.doctor.obey(command)
            case _ if isinstance(command, CalibrationCommand):
                if isinstance(command, LookAtVideos):
                    self.opening.close_page()
                self.calibrating.obey(command)
            case FollowRecording():
                self.recording.obey(command)
            case _ if isinstance(command, SynchronisationCommand):
                self.synchronising.obey(command)
            case CloseQuestion():
                self.asked.put(None)
                self._parts.close_page()
            case CancelJob(name=name):
                self._jobs.give_up(name)
            case DismissNotice(index=index):
                self.notices.dismiss(index)
            case _:
                raise TypeError(f"not a command: {command!r}")

    def _ask_export(self) -> None:
        service = self.live_training.service
        catalog = () if service is None else service.catalog
        trained = tuple(i for i in range(len(catalog)) if catalog[i].state == "trained")
        names = tuple(path.name for path in self.paths.paths)
        self.exporting.ask(self.opened, self.timeline, trained, names, settle=self.document.settle)

    # ---------------------------------------------------------------- letting finished work in

    def poll(self) -> bool:
        """Take in finished work of threads and workers. Whether something visible changed."""
        has_changed = self._jobs.poll()
        has_changed |= self._parts.poll()
        has_changed |= self.lead_view()
        for title, error in self._parts.take_failures():
            if not self.notices.has_told(error):
                self.notices.add_failure(title, error)
        seen = self._news_key()
        has_changed |= seen != self._seen
        self._seen = seen
        if has_changed:
            self._refresh()
        return has_changed

    def _is_training(self) -> bool:
        """Whether cores are for a training now."""
        return self.live_training.is_computing

    def _news_key(self) -> tuple[object, ...]:
        """Differs whenever a thread has finished something, or there is other news."""
        jobs = tuple((job.name, job.done, job.message) for job in self.jobs)
        log = None if self.log.worker.newest is None else self.log.worker.newest[1]
        return self._parts.finished, log, jobs, self.notices.revision

    def _fail(self, job_name: str, error: Exception) -> None:
        self.notices.add_failure(f"{job_name} has failed", error)

    def _refresh(self) -> None:
        """Remake the status values."""
        self.projects.stay()
        self.showing.follow_training()
        live, clip = self.live_training, self.timeline.clip
        self.training = live.status(None if clip is None else clip.clip_index)
        self.clip_states = live.clip_states()
        self.regions = self.marking.status(self.clip_states)
        self.lead_view()
        self.paths, self.history = self.camera_paths.status(), self.document.status()
        self.edits = self.editing.status()
        self.selection = self.selecting.status()
        self.plan, self.queue = live.plan(), live.queue()
        self.usage = self._usage.sample(() if live.service is None else live.service.worker_pids)
        self.project_status = self.projects.status()

    def lead_view(self) -> bool:
        """Let the view follow the camera path, where that is wanted, after the playhead has moved. Whether anything
        changed."""
        has_changed = self.camera_paths.lead(self.views, self.timeline)
        if has_changed:
            self.paths = self.camera_paths.status()
        return has_changed

    def wake_by(self, wake: Callable[[], None]) -> None:
        """Call this, on some thread, when a frame or picture that was asked for is there; it must not block."""
        self.playback.renderer.on_picture = self.playback.decoder.on_frame = self.selecting.on_found = wake

    def close(self) -> None:
        """End workers and threads, keeping progress. Blocks for a few seconds at most, longer only where the disk is at
        fault. May be called twice."""
        if self._is_closed:
            return
        self._is_closed = True
        self._parts.close()
        self._jobs.close(timeout_s=6.0 if self.live_training.is_ending else 1.0)
        self.log.close()
        if self.opened is not None:  # nothing writes into the project any more: its lock goes
            self.opened.project.close()
            self.opened.capture.close()
