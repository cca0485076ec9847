"""Session: the one owner of live state, and the one thing a window talks to. `dispatch` takes commands, `poll` lets
finished work in. Belongs to one thread; nothing here blocks. Draws nothing.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.background.jobs import Job, JobContext, Jobs
from app.background.latest import LatestWorker
from app.plan.next_plan import NextPlan
from app.playback.arrays import AnchorArrays, GaussianArrays, Picture, PointArrays
from app.playback.capture_pictures import CapturedPictures
from app.playback.orbit_view import OrbitView
from app.playback.playback import FrameRequest, Playback, ShownFrame, static_points
from app.playback.preview import make_cloud, picture_hint, read_cloud
from app.playback.render import Renderer
from app.playback.timeline import Timeline
from app.project.clip_catalog import ClipCatalog
from app.project.opening import Opened, open_for_window
from app.project.project import Project, check_settings
from app.project.recents import RecentProject, missing_folders, project_name
from app.session import commands
from app.session.marking import Marking
from app.session.notices import Notice, Notices
from app.session.questions import ProjectQuestion, Question, retrain_question
from app.session.settings import Settings
from app.session.training_notices import tell
from app.status import (
    COMPARE_MODES,
    OVERLAY_NAMES,
    ClipStatus,
    JobStatus,
    Overlays,
    PlanStatus,
    ProjectStatus,
    RegionsStatus,
    TrainingStatus,
    WantedFrame,
)
from app.training.curves import CurveReader
from app.training.messages import ENDINGS, Event, SnapshotWritten, TrainJob
from app.training.process import ProcessWorker, Worker
from app.training.service import Launch, ShownState, TrainingService
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import EngineError
from engine.text import printable
from engine.training.presets import preset

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class PointsRequest:
    """A cloud to show where nothing is trained: of a reference state, or the hint made of pictures.

    Attributes:
        generation: Goes up when another project is opened; see app.background.latest.
    """

    kind: str
    revision: str
    generation: int
    path: Path | None = None
    capture: Capture | None = field(default=None, compare=False)
    is_live: bool = field(default=False, compare=False)


class Session:
    """Everything the program knows while it runs.

    Attributes:
        capture, project: What is open; None before.
        timeline, view, overlays: What the user looks at; the window may change them directly.
        training, clip_states, plan, regions: Status values, remade by `poll` and `dispatch`. The plan is that of the
            next clip; None while something trains or nothing is left to train.
        opened: The open project: its name, where it lies, how far it is trained; None before.
        question: What the user has to answer; None while there is nothing to ask.
        missing: Folders of recent projects that are not there any more.
        notices: What the user has to know.
        holdout: Camera indices that training never sees.

    Args:
        project_dir: Folder for the project of the next capture; the user's data folder when None.
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
        self.capture: Capture | None = None
        self.project: Project | None = None
        self.timeline = Timeline()
        self.view = OrbitView()
        self.overlays = Overlays()
        self.notices = Notices()
        self.settings = Settings() if settings is None else settings
        self.training = TrainingStatus()
        self.clip_states: list[ClipStatus] = []
        self.plan: PlanStatus | None = None
        self.opened: ProjectStatus | None = None
        self.question: Question | None = None
        self.missing: frozenset[Path] = frozenset()
        self.holdout: tuple[int, ...] = ()
        self._project_dir, self._launch, self._opener = project_dir, launch, opener
        self._refusals: list[Notice] = []
        self._service: TrainingService | None = None
        self._closing: list[tuple[TrainingService, Project]] = []
        self._jobs, self._looks = Jobs(self._take_fault), Jobs()
        self._playback = Playback()
        self._renderer = Renderer()
        self._pictures = CapturedPictures()
        self._points: LatestWorker[PointsRequest, PointArrays] = LatestWorker("points", _compute_points)
        self._next_plan = NextPlan()
        self._curves = CurveReader()
        self._marking = Marking()
        self.regions: RegionsStatus = self._marking.status([])
        self._unread: SnapshotWritten | None = None
        self._live_counts: tuple[int, int] | None = None  # anchors of the running clip, once a state was loaded
        self._is_closed = False
        self._is_preloading = is_preloading
        self._opening: object | None = None
        """Stands for what was asked to be opened last."""
        self._first_cloud: Job | None = None
        self._seen = self._finished_keys()
        self._look_for_recent()
        if is_preloading:  # while others import, starting a thread makes the window wait
            for worker in (self._pictures.viewing, self._pictures.thumbnails, self._points, self._curves.worker):
                worker.start()
            self._renderer.worker.start()
            self._playback.worker.start()

    # ---------------------------------------------------------------- what is open

    @property
    def rig(self) -> CameraRig | None:
        """Cameras of the open capture."""
        return None if self.capture is None else self.capture.rig

    @property
    def clips(self) -> list[Clip]:
        """Clips of the open capture."""
        return self.timeline.clips

    @property
    def jobs(self) -> list[JobStatus]:
        """Short jobs that run."""
        return self._jobs.statuses

    # ---------------------------------------------------------------- commands

    def dispatch(self, command: commands.Command) -> None:
        """Carry out a command. What the user could have known better becomes a notice.

        Raises:
            TypeError: The object is not a command.
        """
        try:
            self._obey(command)
        except EngineError as error:
            self.notices.add_error(_TITLES.get(type(command), "That did not work"), error)
        self._refresh()

    def _obey(self, command: commands.Command) -> None:
        match command:
            case commands.OpenCapture(path=path, scale=scale):
                self._open(Path(path), scale, is_new_project=command.is_new_project, follow_links=command.follow_links)
            case commands.OpenProject(path=path):
                self._open(Path(path), None)
            case commands.ForgetRecent(folder=folder):
                self.settings.forget_recent(Path(folder))
            case commands.CloseQuestion():
                self.question = None
            case commands.TrainNextClip():
                self._train(None if self._service is None else self._service.next_clip_index)
            case commands.TrainClip(clip_index=clip_index, is_confirmed=is_confirmed):
                self._train(clip_index, is_confirmed=is_confirmed)
            case commands.PauseTraining():
                self._with_service(TrainingService.pause)
            case commands.ResumeTraining():
                self._with_service(TrainingService.resume)
            case commands.StopTraining():
                self._with_service(TrainingService.stop)
            case commands.SetFrame(frame_index=frame_index):
                self.timeline.seek(frame_index)
            case commands.TogglePlay():
                self.timeline.toggle_play()
            case commands.LookThrough(camera_index=camera_index):
                self.view.look(camera_index)
            case commands.SetCompare(mode=mode):
                if mode not in COMPARE_MODES:
                    raise ValueError(f"compare is one of {', '.join(COMPARE_MODES)}, not {mode!r}")
                self.overlays.compare = mode
            case commands.ToggleOverlay(name=name):
                if name not in OVERLAY_NAMES:
                    raise ValueError(f"overlays are {', '.join(OVERLAY_NAMES)}, not {name!r}")
                setattr(self.overlays, name, not getattr(self.overlays, name))
            case commands.SetHoldout(camera_indices=camera_indices):
                self._set_holdout(camera_indices)
            case commands.SetClipLength(n_frames=n_frames):
                self._change_settings(clip_length=int(n_frames))
            case commands.SetTrainSetting(name=name, value=value):
                self._change_overrides(lambda overrides: overrides | {name: value})
            case commands.SetPreset(name=name):
                self._change_overrides(lambda _: preset(name))
            case commands.MarkRegion(treat=treat, center=center, radius=radius):
                self._marking.mark(treat, center, radius)
            case commands.RemoveRegion(index=index):
                self._marking.remove(index)
            case commands.UndoMark():
                self._marking.undo()
            case commands.RedoMark():
                self._marking.redo()
            case commands.HomeView():
                self.view.home()
            case commands.DismissNotice(index=index):
                self.notices.dismiss(index)
            case _:
                raise TypeError(f"not a command: {command!r}")

    def _with_service(self, act: Callable[[TrainingService], None]) -> None:
        if self._service is not None:
            act(self._service)

    def _train(self, clip_index: int | None, *, is_confirmed: bool = False) -> None:
        service = self._service
        self.question = None
        if service is None:
            self.notices.add("warn", "There is nothing to train yet", "No capture is open.", "Open a capture folder.")
        elif clip_index is None:
            waiting = [
                i for i, status in enumerate(self.clip_states) if status.state in ("damaged", "stale", "untrained")
            ]
            self.notices.add("info", *_NOTHING_TO_TRAIN[bool(waiting)])
        elif not is_confirmed and service.is_finished(clip_index):
            self.question = retrain_question(service.catalog, clip_index)
        else:
            service.enqueue(clip_index)

    def _set_holdout(self, camera_indices: tuple[int, ...]) -> None:
        if self.capture is not None:
            names = self.capture.rig.names
            chosen = tuple(names[index] for index in sorted(set(camera_indices)) if 0 <= index < len(names))
            self._change_settings(holdout=chosen)

    def _change_overrides(self, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
        """Replace the training settings; only those that differ from the defaults are kept."""
        if self.project is not None:
            wanted = replace(self.project.settings, overrides=change(dict(self.project.settings.overrides)))
            self._change_settings(overrides=wanted.config().difference())

    def _change_settings(self, **changes: object) -> None:
        """Replace settings that every clip shares; only while nothing was learned with the old ones."""
        if self.capture is None or self.project is None or self._service is None:
            return
        if self.project.has_progress or self._service.worker is not None:
            self.notices.add(
                "warn",
                "What all clips share is fixed once training has begun",
                "What was learned with them would be worthless.",
                "Use another project folder for other values.",
            )
            return
        settings = self.project.settings
        values = {"clip_length": settings.clip_length, "holdout": settings.holdout} | changes
        changed = replace(settings, **values)  # type: ignore[arg-type]
        check_settings(changed, self.capture)
        self.project.update(changed)
        self._take_clips(self.capture, self.project)

    # ---------------------------------------------------------------- opening

    def _open(
        self, path: Path, scale: float | None, *, is_new_project: bool = False, follow_links: bool = False
    ) -> None:
        current = None if self.project is None else self.project.folder
        recent = tuple(self.settings.recent)
        self.question = None
        self._opening = opening = object()

        def work(context: JobContext) -> Opened:
            return self._opener(
                path,
                scale=scale,
                project_dir=self._project_dir,
                current=current,
                context=context,
                recent=recent,
                is_new_project=is_new_project,
                follow_links=follow_links,
            )

        def take(opened: Opened) -> None:
            if opening is self._opening:
                self._take_opened(opened)
            elif opened.project is not None:  # something else was asked for meanwhile
                opened.project.close()
                opened.capture.close()

        def failed(error: Exception) -> None:
            name = printable(path.name or str(path))
            if isinstance(error, EngineError):
                self._refusals.append(self.notices.add_error(f"{name} cannot be opened", error))
            else:
                self._report_fault(f"{name} cannot be opened", error)

        self._jobs.start("Opening", work, take, failed)

    def _take_opened(self, opened: Opened) -> None:
        for notice in self._refusals:  # something is open now; why something else was not no longer matters
            self.notices.withdraw(notice)
        self._refusals.clear()
        if opened.choices:
            self.question = ProjectQuestion(str(opened.capture.path), opened.choices, opened.follow_links)
            return
        if opened.project is None:  # it is open already
            self.view.home()
            return
        self._retire()
        self.capture, self.project = opened.capture, opened.project
        self.view = OrbitView(opened.capture.rig)
        self._marking.open(opened.project)
        self._take_clips(opened.capture, opened.project, opened.catalog)
        self._keep_recent()
        for sentence in opened.capture.warnings:
            self.notices.add("warn", "The capture is odd but usable", sentence)
        if opened.note is not None:
            self.notices.add(*opened.note)
        if self._is_preloading and opened.project.is_writable:
            self._build_first_cloud(opened.capture, opened.project)

    def _build_first_cloud(self, capture: Capture, project: Project) -> None:
        """Something of the scene to look at until the first training has built the real cloud."""
        path = project.first_cloud_path
        if path.is_file() or self._state_of(self.reference_index) is not None:
            return
        capture_path, holdout, follow_links = capture.path, self.holdout, capture.follow_links

        def work(context: JobContext) -> Path:
            return make_cloud(capture_path, holdout=holdout, path=path, context=context, follow_links=follow_links)

        def failed(error: Exception) -> None:  # the hint stays; training will say what is wrong
            logger.warning("no first cloud: %s", error)

        self._first_cloud = self._jobs.start("Building a first cloud", work, lambda _: None, failed)

    def _keep_recent(self) -> None:
        """Put the open project, as far as it is trained now, first in the list of recent ones."""
        if self.project is None or self.capture is None or self._service is None:
            return
        catalog, place = self._service.catalog, str(Path(self.capture.path).resolve())
        folder = self.project.folder.resolve()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        name = project_name(folder, place)
        self.settings.add_recent(RecentProject(str(folder), place, name, catalog.n_trained, len(catalog), now))

    def _look_for_recent(self) -> None:
        """See on a thread which of the recent projects are still there: a network folder may take its time."""
        entries = tuple(self.settings.recent)

        def found(missing: frozenset[Path]) -> None:
            self.missing = missing

        def failed(error: Exception) -> None:
            logger.warning("recent projects could not be looked for: %s", error)

        self._looks.start("Looking for recent projects", lambda context: missing_folders(entries), found, failed)

    def _take_clips(self, capture: Capture, project: Project, catalog: ClipCatalog | None = None) -> None:
        frame_index = self.timeline.frame_index
        self.timeline = Timeline(project.clips(capture.n_frames), fps=capture.fps)
        self.timeline.seek(frame_index if self._service is not None else 0)
        known = [name for name in project.settings.holdout if name in capture.rig.names]
        self.holdout = tuple(capture.camera_indices(known))
        if self._service is not None:
            self._service.close()
        self._service = TrainingService(
            project,
            self.timeline.clips,
            holdout=self.holdout,
            launch=self._launch_worker,
            catalog=catalog,
            curves=self._curves,
        )

    def _launch_worker(self, job: TrainJob, project: Project) -> Worker:
        self._marking.settle()  # a region marked a moment ago is meant to count
        return self._launch(job, project)

    def _retire(self) -> None:
        """Let go of what was open; a training still running is ended on a thread, keeping what it learned."""
        for store in (self._playback, self._renderer, self._pictures):
            store.clear()
        self._points.forget()
        self._next_plan.forget()
        self._marking.leave()
        if self._first_cloud is not None:
            self._first_cloud.context.cancel()
        self._unread = self._live_counts = None
        service, project, self._service = self._service, self.project, None
        if service is None or project is None:
            return
        if service.worker is None:
            service.close()
            project.close()
            return
        self._closing.append((service, project))

        def work(context: JobContext) -> None:
            service.close()
            project.close()

        self._jobs.start("Keeping what was learned", work, lambda _: self._closing.clear(), self._forget_closing)

    def _forget_closing(self, error: Exception) -> None:
        self._closing.clear()
        self._report_fault("A training could not be ended properly", error)

    # ---------------------------------------------------------------- letting finished work in

    def poll(self) -> bool:
        """Take in what threads and workers finished. Whether something visible changed."""
        has_changed = self._jobs.poll()
        self._looks.poll()
        if self._service is not None:
            for event in self._service.poll():
                self._take_event(event)
                has_changed = True
        self._release_snapshot()
        has_changed |= self._marking.poll()
        self._collect_errors()
        seen = self._finished_keys()
        has_changed |= seen != self._seen
        self._seen = seen
        if has_changed:
            self._refresh()
        return has_changed

    def _finished_keys(self) -> tuple[object, ...]:
        workers = (self._playback.worker, self._renderer.worker, self._pictures.viewing, self._pictures.thumbnails)
        newest = [worker.newest for worker in (*workers, self._points, self._next_plan, self._curves.worker)]
        statuses = [(job.name, job.done, job.message) for job in self.jobs]
        return (
            *(None if found is None else found[0] for found in newest),
            *statuses,
            self.notices.revision,
            self.missing,
        )

    def _take_event(self, event: Event) -> None:
        tell(event, self.notices)
        if isinstance(event, SnapshotWritten):
            self._unread = event
        elif isinstance(event, ENDINGS):
            self._unread = self._live_counts = None
            self._keep_recent()

    def _release_snapshot(self) -> None:
        """Tell the worker that its snapshot was read, or that nobody looks at that clip."""
        service, unread = self._service, self._unread
        if service is None or unread is None or service.worker is None:
            return
        clip_index = service.worker.job.clip_index
        shown = self.timeline.clip
        is_shown = shown is not None and shown.clip_index == clip_index
        if is_shown:
            self.shown_gaussians()  # asks for it, should the window not have done so
        request = self._frame_request()
        if not is_shown or (request is not None and self._playback.is_loaded(request)):
            service.snapshot_consumed(clip_index, unread.revision)
            self._unread = None

    def _collect_errors(self) -> None:
        sources = (
            (self._playback.worker, "The clip cannot be shown"),
            (self._renderer.worker, "The picture could not be drawn"),
            (self._pictures.viewing, "A captured picture cannot be shown"),
            (self._pictures.thumbnails, "A captured picture cannot be shown"),
            (self._points, "The cloud cannot be shown"),
            (self._marking, "The marked regions could not be read or kept"),
        )
        for worker, title in sources:
            found = worker.take_error()
            if found is None:
                continue
            request, error = found
            if isinstance(request, FrameRequest | PointsRequest) and request.is_live:
                if self._unread is not None:  # it may have been replaced meanwhile; the next one comes soon
                    self._with_service(TrainingService.snapshot_now)
                    self._drop_unread()
                logger.info("a live state could not be read: %s", error)
            elif isinstance(error, EngineError):
                if self._service is not None and isinstance(request, FrameRequest | PointsRequest):
                    self._service.catalog.note_damage(error.path, error.message)
                if not any(str(error.message) in notice.detail for notice in self.notices):
                    self.notices.add_error(title, error)
            else:
                self._report_fault(title, error)

    def _drop_unread(self) -> None:
        if self._service is not None and self._service.worker is not None and self._unread is not None:
            self._service.snapshot_consumed(self._service.worker.job.clip_index, self._unread.revision)
        self._unread = None

    def _take_fault(self, job_name: str, error: Exception) -> None:
        if isinstance(error, EngineError):
            self.notices.add_error(f"{job_name} has failed", error)
        else:
            self._report_fault(f"{job_name} has failed", error)

    def _report_fault(self, title: str, error: Exception) -> None:
        logger.error("%s", title, exc_info=error)
        self.notices.add(
            "error", title, f"{type(error).__name__}: {error}", "This is a fault of the program; the log has more."
        )

    def _refresh(self) -> None:
        """Remake the status values."""
        if self._service is None:
            self.training, self.clip_states, self.plan, self.opened = TrainingStatus(), [], None, None
            self.regions = self._marking.status([])
            return
        clip = self.timeline.clip
        request = self._frame_request()
        anchors = None if request is None or not request.is_live else self._playback.anchors(request)
        if anchors is not None:
            self._live_counts = (len(anchors.inherited_positions), len(anchors.own_positions))
        self.training = self._service.status(None if clip is None else clip.clip_index)
        self.clip_states = self._service.clip_statuses(self._live_counts)
        self.regions = self._marking.status(self.clip_states)
        self.plan = None
        if self.project is not None and self.capture is not None:
            self.opened = self._project_status(self.project, self._service.catalog)
            can_measure = self._is_preloading and not self.jobs
            self.plan = self._next_plan.status(self._service, self.project, self.capture, can_measure=can_measure)

    def _project_status(self, project: Project, catalog: ClipCatalog) -> ProjectStatus:
        name = project_name(project.folder.absolute(), project.settings.capture)
        return ProjectStatus(name, project.folder, catalog.n_trained, len(catalog), project.is_writable)

    def close(self) -> None:
        """End workers and threads, keeping what was learned. Blocks for a few seconds at most. May be called twice."""
        if self._is_closed:
            return
        self._is_closed = True
        self._marking.close()
        if self._service is not None:
            self._service.close()
            self._keep_recent()
        if self.project is not None:
            self.project.close()
        self._looks.close(timeout_s=0.1)
        self._curves.close()
        self._jobs.close(timeout_s=6.0 if self._closing else 1.0)
        for worker in (self._playback, self._renderer, self._pictures, self._points):
            worker.close()
        self._next_plan.close()
        if self.capture is not None:
            self.capture.close()

    # ---------------------------------------------------------------- pictures and arrays

    def _state_of(self, clip_index: int) -> ShownState | None:
        """The state of a clip to look at."""
        return None if self._service is None else self._service.shown_state(clip_index)

    def shown_gaussians(self) -> GaussianArrays | None:
        """Gaussians of the shown frame; the newest ones there are until those are decoded; None where nothing is
        trained."""
        shown = self._shown_frame()
        return None if shown is None else shown.gaussians

    def _shown_frame(self) -> ShownFrame | None:
        request = self._frame_request()
        return None if request is None else self._playback.frame(request)

    def _frame_request(self) -> FrameRequest | None:
        """What is to be decoded for the playhead; None where nothing is trained."""
        clip = self.timeline.clip
        known = None if clip is None else self._state_of(clip.clip_index)
        if clip is None or known is None or self.project is None:
            return None
        return FrameRequest(
            clip_index=clip.clip_index,
            revision=known.revision,
            frame_index=self.timeline.frame_index,
            path=known.file,
            reference_path=self._inherited_path(clip.clip_index),
            clip=clip,
            is_live=known.is_live,
        )

    def wanted_frame(self) -> WantedFrame | None:
        """What ought to be on screen; None without a capture. What is there says itself what it is."""
        clip, request = self.timeline.clip, self._frame_request()
        if clip is None:
            return None
        wanted = WantedFrame(
            clip.clip_index,
            self.timeline.frame_index,
            camera_index=self.view.look_through,
            look=self.view.look_key,
        )
        if request is None:
            return wanted
        return replace(
            wanted,
            revision=request.revision,
            is_loaded=self._playback.is_loaded(request),
            has_failed=self._playback.has_failed(request) or self._renderer.has_failed,
        )

    @property
    def reference_index(self) -> int:
        """The clip that the others inherit from."""
        return 0 if self.project is None else self.project.settings.reference_clip

    def _inherited_path(self, clip_index: int) -> Path | None:
        assert self.project is not None
        base = self.project.inherited_index(clip_index)
        return None if base is None else self.project.clip_path(base)

    def shown_anchors(self) -> AnchorArrays | None:
        """Anchors that exist at the shown frame; those of the newest frame there is until it was decoded."""
        shown = self._shown_frame()
        return None if shown is None else shown.anchors

    def shown_points(self) -> PointArrays | None:
        """A cloud for frames that are not trained: the still part of the reference clip, before that a rough first
        cloud, before that a hint.

        None until it is made, and through a capture camera while there is only the hint: the captured picture itself
        says more there.
        """
        if self.capture is None:
            return None
        generation = self._points.generation
        reference = self._state_of(self.reference_index)
        if reference is not None:
            is_live = reference.is_live
            request = PointsRequest("cloud", reference.revision, generation, reference.file, is_live=is_live)
        elif self.project is not None and self.project.first_cloud_path.is_file():
            request = PointsRequest("first cloud", "", generation, self.project.first_cloud_path)
        else:
            request = PointsRequest("hint", "", generation, capture=self.capture)
        newest = self._points.newest
        if newest is None or newest[0] != request:
            self._points.request(request)
        if newest is None or (newest[1].is_hint and self.view.look_through is not None):
            return None
        return newest[1]

    def request_render(self, width: int, height: int) -> Picture | None:
        """The rasterizer's picture of the frame and view; None where nothing is trained or ready.

        Stale where it is of another frame, view, size or state of the clip; it says of which.
        """
        request, gaussians = self._frame_request(), self.shown_gaussians()
        if request is None or gaussians is None:
            return None
        picture = self._renderer.picture(gaussians, self.view, width, height)
        if picture is None or picture.is_stale:
            return picture
        source = picture.source
        is_of_now = (source.clip_index, source.frame_index, source.revision) == (
            request.clip_index,
            request.frame_index,
            request.revision,
        )
        return picture if is_of_now else replace(picture, is_stale=True)

    def ground_truth(self, camera_index: int, frame_index: int, max_width: int) -> Picture | None:
        """The captured picture, at most `max_width` pixels wide; None until it was decoded."""
        if self.capture is None:
            return None
        return self._pictures.picture(self.capture, camera_index, frame_index, max_width)


_NOTHING_TO_TRAIN = {
    False: ("Every clip is trained",),
    True: (
        "No clip can be trained next",
        "What is left is damaged, or needs a clip that is.",
        "Restore the damaged file from a copy, or train the clip again: right-click it in the timeline.",
    ),
}
"""By whether there is a clip that is not trained: title, detail and hint."""

_TITLES: dict[type, str] = {
    commands.TrainClip: "The clip cannot be trained",
    commands.TrainNextClip: "The clip cannot be trained",
    commands.SetHoldout: "These cameras cannot be held out",
    commands.SetClipLength: "The clip length cannot be changed",
    commands.SetTrainSetting: "The setting cannot be changed",
    commands.SetPreset: "The preset cannot be taken",
    commands.MarkRegion: "The region cannot be marked",
    commands.RemoveRegion: "The region cannot be removed",
    commands.UndoMark: "The last mark cannot be taken back",
    commands.RedoMark: "The mark cannot be made again",
}


def _compute_points(request: PointsRequest) -> PointArrays:
    if request.path is not None and request.kind == "first cloud":
        return read_cloud(request.path)
    if request.path is not None:
        return static_points(request.path, request.revision)
    assert request.capture is not None
    return picture_hint(request.capture, 0)
