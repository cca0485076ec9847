"""LiveTraining: the training of the open project as a session sees it. Its service and events, its snapshots, its
curves, and the plan of the next clip.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

from app.background.jobs import JobContext, Jobs
from app.background.latest import nothing
from app.document.project_document import ProjectDocument
from app.plan.forecasts import Forecasts
from app.playback.modes.arrays import AnchorArrays
from app.project.allowed_changes import check_change, is_other_cut
from app.project.claims.left_over import check_unclaimed
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.questions import RetrainQuestion, retrain_question
from app.session.training.others import Others
from app.session.training.places import TrainingPlaces
from app.session.training.training_notices import tell, tell_dropped
from app.status import ClipStatus, PlanStatus, QueueStatus, TrainingStatus
from app.training.clip_run import ShownState
from app.training.curves import CurveReader, Curves
from app.training.messages import ENDINGS, SnapshotWritten, TrainJob
from app.training.process import Worker
from app.training.service import Launch, TrainingService
from app.training.train_queue import OwnSettings
from app.training.training_status import ClipStatuses, curves_of, training_status
from engine.errors import EngineError, ProjectError

logger = logging.getLogger(__name__)


class LiveTraining(SessionPart):
    """The running training, its queue and results. For one thread, and nothing here waits.

    At most one snapshot of each running training is unread: its worker writes no other before that was given back.

    Args:
        jobs, notices: Of the session.
        launch: Starts a worker.
        settle: Waits a moment until edits are on disk, where workers read it.
        can_measure: Whether plans may time the machine.
        live_view: How often running clips are shown anew, one of app.training.messages.LIVE_VIEWS.
    """

    def __init__(
        self,
        jobs: Jobs,
        notices: Notices,
        *,
        launch: Launch,
        settle: Callable[[], object] = nothing,
        can_measure: bool = True,
        live_view: str = "live",
    ) -> None:
        self.service: TrainingService | None = None
        self._opened: OpenedProject | None = None
        self._jobs, self._notices, self._can_measure = jobs, notices, can_measure
        self._forecasts, self._curves = Forecasts(), CurveReader()
        self._live_view, self._settle = live_view, settle
        self._places, self._others = TrainingPlaces(launch), Others(jobs, notices)
        self._statuses: ClipStatuses | None = None
        self._unread: dict[int, SnapshotWritten] = {}
        self._live_counts: tuple[int, int, int] | None = None
        self._catalog: ClipCatalog | None = None
        self.n_ended = 0
        self._n_ending = 0
        self._ended_clip: int | None = None

    def start(self) -> None:
        """Start the thread of the curves now rather than with the first request."""
        self._curves.worker.start()

    def open(self, opened: OpenedProject) -> None:
        """Take up a project, or the same one with other settings. A training of another one is ended on a thread,
        keeping progress."""
        service, before = self.service, self._opened
        if service is not None and before is not None:
            if before.generation == opened.generation:
                service.close()
            else:
                self._retire(service, before)
        if before is None or before.generation != opened.generation:
            self._ended_clip = None
        self._opened = opened
        self.service = TrainingService(
            opened.project,
            opened.clips,
            holdout=opened.holdout,
            launch=self._launch_settled,
            catalog=self._catalog,
            curves=self._curves,
        )
        self.service.claims.watch()
        self.service.looked_at.mode, self.service.n_workers = self._live_view, self._places.n_workers
        self._statuses = ClipStatuses(self.service)
        self._catalog = None

    def _launch_settled(self, job: TrainJob, project: Project) -> Worker:
        self._settle()  # a region marked a moment ago is meant to count
        return self._places.launch(job, project)

    def take_catalog(self, catalog: ClipCatalog | None) -> None:
        """The clips on disk of the project that is opened next; read then when None."""
        self._catalog = catalog

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def grow(self, opened: OpenedProject) -> None:
        """Its capture has grown: what trains and waits goes on."""
        assert self.service is not None
        self._opened = opened
        self.service.extend(opened.clips)
        self._statuses = ClipStatuses(self.service)

    def _retire(self, service: TrainingService, opened: OpenedProject) -> None:
        self._forecasts.forget()
        self._unread, self._live_counts = {}, None
        if not service.is_busy:
            service.close()
            opened.project.close()
            return
        self._n_ending += 1

        def work(context: JobContext) -> None:
            service.close()
            opened.project.close()

        def failed(error: Exception) -> None:
            self._n_ending -= 1
            self._notices.add_failure("A training could not be ended properly", error)

        def done(_: None) -> None:
            self._n_ending -= 1

        self._jobs.start("Saving progress", work, done, failed)

    @property
    def is_ending(self) -> bool:
        """Whether a training of a project that was left is still being ended."""
        return self._n_ending > 0

    @property
    def is_busy(self) -> bool:
        """Whether a clip of the open project trains."""
        return self.service is not None and self.service.is_busy

    @property
    def is_busy_anywhere(self) -> bool:
        """Whether a clip of the open project trains, here or elsewhere."""
        return self.is_busy or (self.service is not None and bool(self.service.elsewhere))

    @property
    def is_computing(self) -> bool:
        """Whether a clip of the open project trains here and is not paused."""
        return self.service is not None and any(not run.is_paused for run in self.service.runs.values())

    def check_not_training(self) -> None:
        """Check that nothing trains or waits to be trained, so that clips may be cut otherwise.

        Raises:
            ProjectError: Something does.
        """
        if self.service is not None and (self.service.is_busy or self.service.queue):
            raise ProjectError(
                "Clips are training or queued.",
                hint="Stop training first; progress is kept.",
            )
        if self._opened is not None:
            check_unclaimed(self._opened.project.folder)

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """Check that no clip is finished with settings that change. Raises ProjectError."""
        if is_other_cut(before.settings, after.settings):
            self.check_not_training()
        if self._opened is not None:
            check_change(self._opened.project, self._opened.capture, before, after, is_training=self.is_busy)

    def is_finished(self, clip_index: int) -> bool:
        """Whether a finished clip, or a damaged one, would be replaced by training this one."""
        return self.service is not None and self.service.is_finished(clip_index)

    def state_of(self, clip_index: int) -> ShownState | None:
        """The state of a clip to look at."""
        return None if self.service is None else self.service.shown_state(clip_index)

    # ---------------------------------------------------------------- commands

    def train_next(self) -> None:
        """Train the first clip that is not finished, or continue with a queue that was held.

        Raises:
            ProjectError: It cannot be trained.
        """
        service = self.service
        if service is None:
            self.tell_nothing_open()
        elif not service.is_busy and service.queue:
            service.go_on()
        elif service.next_clip_index is not None:
            self.opened_project.capture.check_pictures()
            service.enqueue(service.next_clip_index)
        elif any(status.state in ("damaged", "stale", "untrained") for status in self.clip_states()):
            self._notices.add(
                "info",
                "No clip can be trained next",
                "The remaining clips are damaged, or need a damaged clip.",
                "Restore the damaged file from a backup, or train the clip again: right-click it in the timeline.",
            )
        else:
            self._notices.add("info", "Every clip is trained")

    def train(self, clip_index: int, *, is_confirmed: bool, own: OwnSettings | None = None) -> RetrainQuestion | None:
        """Train a clip, or return the question before a finished one is trained again.

        Args:
            own: Settings that it alone is to have.
        Raises:
            ProjectError: It cannot be trained.
            CaptureError: The scene was imported and has no pictures.
        """
        if self.service is None:
            self.tell_nothing_open()
            return None
        self.opened_project.capture.check_pictures()
        if not is_confirmed and self.service.is_finished(clip_index):
            return retrain_question(self.service.catalog, clip_index)
        self.service.enqueue(clip_index, own or None)
        return None

    @property
    def opened_project(self) -> OpenedProject:
        """The open project. There has to be one."""
        assert self._opened is not None
        return self._opened

    def set_live_view(self, mode: str) -> None:
        """How often running clips are shown anew, from now on."""
        self._live_view = mode
        if self.service is not None:
            self.service.set_live_view(mode)

    def tell_nothing_open(self) -> None:
        """Tell the user that no capture is open."""
        self._notices.add("warn", "Nothing to train yet", "No capture is open.", "Open a capture folder.")

    def pause(self, clip_index: int | None = None) -> None:
        """Hold a clip where it is; all that train here when None."""
        if self.service is not None and not self._others.ask(self.service, clip_index, "pause"):
            self.service.pause(clip_index)

    def resume(self, clip_index: int | None = None) -> None:
        """Resume a clip after a pause; when None all of them, or continue with a queue that was held."""
        if self.service is not None and not self._others.ask(self.service, clip_index, "resume"):
            self.service.resume(clip_index)
            if clip_index is None:
                self.service.go_on()

    def stop(self, clip_index: int | None = None) -> None:
        """End the training of a clip, keeping progress; when None of all, which also empties the queue."""
        if self.service is not None and not self._others.ask(self.service, clip_index, "stop"):
            self.service.stop(clip_index)

    def set_workers(self, n: int) -> None:
        """Let so many clips train side by side on this computer, if it can."""
        self._places.want(n)
        self._follow_places()

    def use(self, launch: Launch | None, n_workers: int = 1) -> None:
        """Start workers elsewhere from now on, at most so many at a time; here again when None."""
        self._places.use(launch, n_workers)
        self._follow_places()

    def _follow_places(self) -> None:
        if self.service is None:
            return
        newest = self._forecasts.newest
        is_known = newest is not None and newest[0].project is self.service.project
        self._places.decide(self.service, newest[1].kinds if newest is not None and is_known else {})
        if self.service.n_workers != self._places.n_workers:
            self.service.set_workers(self._places.n_workers)

    def look_at(self, clip_index: int | None, *, is_following: bool) -> None:
        """The clip at the playhead is looked at, and where the playhead follows the training, the one that leads it."""
        if self.service is not None:
            leading = self.service.running_clip if is_following else None
            looked_at = {index for index in (clip_index, leading) if index is not None}
            self.service.looked_at.look_at(looked_at, self.service.runs.values())

    # ---------------------------------------------------------------- events of the workers

    def poll(self) -> bool:
        """Take in the workers' events, with notices to the user. Whether there were any."""
        events = [] if self.service is None else self.service.poll()
        for clip_index, event in events:
            tell(event, self._notices, clip_index)
            if isinstance(event, SnapshotWritten):
                self._unread[clip_index] = event
            elif isinstance(event, ENDINGS):
                self.n_ended += 1
                self._unread.pop(clip_index, None)
                if self._live_counts is not None and self._live_counts[0] == clip_index:
                    self._live_counts = None
                if self.state_of(clip_index) is not None:
                    self._ended_clip = clip_index
        if self.service is not None:
            self._others.hear(self.service)
            self._follow_places()
        if events and self.service is not None:
            tell_dropped(self.service.take_dropped(), self._notices)
        return bool(events)

    @property
    def newest_clip(self) -> int | None:
        """The clip with the newest state to look at: the one that trains once it has one, else the one whose training
        has ended last, else the last one that is trained; None where there is none."""
        service = self.service
        if service is None:
            return None
        running = service.running_clip
        state = None if running is None else service.shown_state(running)
        if state is not None and state.is_live:
            return running
        if self._ended_clip is not None:
            return self._ended_clip
        return next((index for index in reversed(service.catalog.order) if service.is_finished(index)), None)

    @property
    def unread_clips(self) -> tuple[int, ...]:
        """Clips with a snapshot that nobody has read yet."""
        return tuple(self._unread)

    def give_back_snapshots(self, *, but: int | None = None) -> None:
        """They were read, or nobody looks at their clips: their workers may write the next ones.

        Args:
            but: A clip whose snapshot is still to be read.
        """
        for clip_index in [clip_index for clip_index in self._unread if clip_index != but]:
            unread = self._unread.pop(clip_index)
            if self.service is not None:
                self.service.snapshot_consumed(clip_index, unread.revision)

    def replace_snapshot(self, error: Exception) -> None:
        """One could not be read. It may have been replaced meanwhile; if not, another one is asked for."""
        logger.info("a live state could not be read: %s", error)
        if self.service is not None:
            for clip_index in self._unread:
                self.service.snapshot_now(clip_index)
            self.give_back_snapshots()

    def note_anchors(self, clip_index: int, anchors: AnchorArrays | None) -> None:
        """All anchors of a clip, once a live state of it was loaded."""
        if anchors is not None:
            self._live_counts = (clip_index, len(anchors.inherited_positions), len(anchors.own_positions))

    def note_damage(self, error: Exception) -> None:
        """The file of a clip could not be read."""
        if self.service is not None and isinstance(error, EngineError):
            self.service.catalog.note_damage(error.path, error.message)

    # ---------------------------------------------------------------- status

    def status(self, viewed_clip: int | None) -> TrainingStatus:
        """The training as a whole.

        Args:
            viewed_clip: The clip at the playhead.
        """
        if self.service is None:
            return TrainingStatus()
        return replace(training_status(self.service, viewed_clip), why_fewer=self._places.why_fewer)

    def clip_states(self) -> list[ClipStatus]:
        """One status per clip."""
        return [] if self._statuses is None else self._statuses.all(self._live_counts)

    def plan(self) -> PlanStatus | None:
        """Time and memory for training the next clip; None while something trains or nothing is left to train."""
        if self.service is None or self._opened is None:
            return None
        opened, can_measure = self._opened, self._can_measure and not self._jobs.statuses
        return self._forecasts.next_clip(self.service, opened.project, opened.capture, can_measure=can_measure)

    def queue(self) -> QueueStatus:
        """The waiting clips, and the time for all of them."""
        if self.service is None or self._opened is None:
            return QueueStatus(live_view=self._live_view)
        opened, can_measure = self._opened, self._can_measure and not self._jobs.statuses
        return self._forecasts.queue(self.service, opened.project, opened.capture, can_measure=can_measure)

    def curves(self, clip_index: int) -> Curves | None:
        """Loss and PSNR over the steps of a clip; None until they were read."""
        return None if self.service is None else curves_of(self.service, clip_index)

    @property
    def finished(self) -> tuple[object, ...]:
        """Identities of the newest plans and curves, and what is known of trainings elsewhere. Another value means that
        there is something new to see."""
        newest = (self._forecasts.newest, self._curves.worker.newest)
        revision = None if self.service is None else self.service.catalog.revision
        return (*(None if found is None else found[0] for found in newest), self._others.heard, revision)

    def close(self) -> None:
        """End the worker, keeping progress, and the threads. Blocks for a few seconds at most."""
        if self.service is not None:
            self.service.close()
        self._curves.close()
        self._forecasts.close()
