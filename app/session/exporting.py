"""Exporting: the export dialog, the estimated export, and the queue of exports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from app.background.jobs import JobContext, Jobs
from app.background.latest import LatestWorker, nothing
from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_plan import ExportPlan, plan_export, suggested_out
from app.export.jobs.answers import Answers
from app.export.jobs.table import KINDS
from app.export.queue.export_jobs import ExportTask
from app.export.queue.export_process import Exporter, ExportProcess
from app.export.queue.export_queue import ExportQueue
from app.export.queue.export_status import ExportStatus
from app.export.show_in_folder import show_in_folder
from app.playback.timeline import Timeline
from app.project.opening.opened_project import OpenedProject
from app.project.projects_folder import project_name
from app.session.export_commands import (
    CancelExport,
    ClearExports,
    ExportCommand,
    MoveExport,
    RemoveExport,
    RetryExport,
    ShowExport,
    StartExport,
)
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.projects.settings import Settings
from engine.capture.frames import VideoFrames
from engine.errors import EngineError, ProjectError

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject


@dataclass(frozen=True, slots=True)
class ExportPage:
    """Contents of the dialog.

    Attributes:
        context: Of the open project, when the dialog was opened.
        choices: At the beginning; the place is asked for with `Exporting.suggest`.
    """

    context: ExportContext
    choices: ExportChoices


class _Wish(NamedTuple):
    """Of the workers; equal ones are looked at once.

    Attributes:
        n_asked: Number of the page; a new page looks at everything again.
        taken: Paths that running and waiting exports will write.
        folder: Of the export before; empty for none.
    """

    n_asked: int
    generation: int
    context: ExportContext
    choices: ExportChoices
    taken: tuple[Path, ...]
    folder: str = ""


class Exporting(SessionPart):
    """For one thread, which does not wait.

    Attributes:
        page: Shown now; None for none.

    Args:
        notices: Receive failures.
        settings: Keep the last choices.
        launch: Starts an export; a process by default.
        show: Shows a file in the system's file manager; called on a thread.
        is_training: Whether cores are for a training now.
    """

    def __init__(
        self,
        notices: Notices,
        settings: Settings,
        *,
        launch: Callable[[ExportTask], Exporter] = ExportProcess,
        show: Callable[[Path], None] = show_in_folder,
        is_training: Callable[[], bool] = lambda: False,
    ) -> None:
        self.page: ExportPage | None = None
        self._notices, self._settings, self._show = notices, settings, show
        self._is_training = is_training
        self._queue = ExportQueue(launch=launch)
        self._jobs = Jobs()
        self._planner: LatestWorker[_Wish, ExportPlan] = LatestWorker("export plan", self._plan)
        self._namer: LatestWorker[_Wish, str] = LatestWorker("export name", _name)
        self._opened: OpenedProject | None = None
        self._project = Path()
        self._n_asked = 0
        self._settle: Callable[[], object] = nothing
        self._read: tuple[object, TrainedProject] | None = None  # belongs to the planner's thread
        self._settled = 0  # likewise: number of the page
        self._revision = 0

    @property
    def statuses(self) -> tuple[ExportStatus, ...]:
        """The queue: exports that run or wait, and those of the open project that have ended."""
        return tuple(one for one in self._queue.statuses if not one.is_over or one.project == self._project)

    @property
    def is_busy(self) -> bool:
        """Whether an export runs or waits."""
        return self._queue.is_busy

    @property
    def finished(self) -> tuple[object, ...]:
        """Differs whenever there is something else to show."""
        return self._revision, self._queue.revision, self._planner.newest, self._namer.newest

    def open(self, opened: OpenedProject) -> None:
        """Another project is open: ended exports of others are not listed. Running ones continue."""
        self._project = opened.project.folder.absolute()
        self._revision += 1

    # ---- the dialog

    def ask(
        self,
        opened: OpenedProject | None,
        timeline: Timeline,
        trained: tuple[int, ...],
        paths: tuple[str, ...] = (),
        *,
        settle: Callable[[], object] = nothing,
    ) -> None:
        """Open the dialog.

        Args:
            trained: Indices of the clips that are finished.
            paths: Names of the camera paths.
            settle: Waits until the camera paths are on the disk, where exports read them; called on a thread before
                the estimate, and so before an export can begin.
        Raises:
            ProjectError: Nothing is trained yet.
        """
        if opened is None:
            return
        if not trained:
            raise ProjectError("Nothing to export yet: no clip is trained.", hint="Train a clip first.")
        context = _context(opened, timeline, trained, paths)
        last = self._settings.last_export
        if last.kind not in KINDS:
            last = last.changed(kind=next(iter(KINDS)))
        self._opened, self._settle = opened, settle
        self._n_asked += 1
        self.page = ExportPage(context, last.changed(out=""))
        self._revision += 1

    def suggest(self, choices: ExportChoices) -> str | None:
        """A place for an export, next to the last one; None until one was looked for."""
        last, wish = self._settings.last_export.out, self._wish(choices.changed(out=""))
        if wish is None:
            return None
        wish = wish._replace(folder=str(Path(last).parent) if last else "")
        newest = self._namer.newest
        if newest is not None and newest[0] == wish:
            return newest[1]
        if self._namer.has_failed(wish):
            return ""  # the user has to say where
        self._namer.request(wish)
        return None

    def plan(self, choices: ExportChoices) -> ExportPlan | None:
        """The estimated export; None until it was estimated."""
        wish = self._wish(choices)
        if wish is None:
            return None
        newest = self._planner.newest
        if newest is not None and newest[0] == wish:
            return newest[1]
        if self._planner.has_failed(wish):
            error = self._planner.take_error()
            reason = "" if error is None else f": {error[1]}"
            return ExportPlan(choices, problems=(f"This could not be estimated{reason}.",))
        self._planner.request(wish)
        return None

    def _wish(self, choices: ExportChoices) -> _Wish | None:
        if self.page is None or self._opened is None:
            return None
        return _Wish(self._n_asked, self._opened.generation, self.page.context, choices, self._queue.targets)

    def close_page(self) -> None:
        """Close the page."""
        if self.page is not None:
            self.page = None
            self._revision += 1

    # ---- the queue

    def apply(self, command: ExportCommand) -> None:
        """Carry out a command on the queue; asking is `ask`."""
        match command:
            case StartExport(choices=choices):
                self.start(choices)
            case CancelExport(export_id=export_id):
                self.cancel(export_id)
            case RetryExport(export_id=export_id):
                self.retry(export_id)
            case MoveExport(export_id=export_id, place=place):
                self.move(export_id, place)
            case RemoveExport(export_id=export_id):
                self.remove(export_id)
            case ClearExports():
                self.clear()
            case ShowExport(export_id=export_id):
                self.show(export_id)

    def start(self, choices: ExportChoices) -> None:
        """Put an export into the queue, and keep the choices.

        Raises:
            ProjectError: Another export that runs or waits writes to the same place.
        """
        page, opened = self.page, self._opened
        if page is None or opened is None:
            return
        answers = Answers(page.context, choices)
        capture = opened.capture
        task = ExportTask(
            job=answers.make_job(),
            project=str(opened.project.folder.absolute()),
            capture=str(Path(capture.path).absolute()),
            scale=capture.scale,
            frames=capture.frames,
            follow_links=capture.follow_links,
        )
        self._queue.add(task, answers.title)
        self._settings.set_last_export(choices)
        self.close_page()

    def cancel(self, export_id: int) -> None:
        """See ExportQueue."""
        self._queue.cancel(export_id)

    def remove(self, export_id: int) -> None:
        """See ExportQueue."""
        self._queue.remove(export_id)

    def clear(self) -> None:
        """Take all that have ended out of the list."""
        for status in self.statuses:
            if status.is_over:
                self._queue.remove(status.export_id)

    def move(self, export_id: int, place: int) -> None:
        """See ExportQueue."""
        self._queue.move(export_id, place)

    def retry(self, export_id: int) -> None:
        """See ExportQueue."""
        self._queue.retry(export_id)

    def show(self, export_id: int) -> None:
        """Show the written files in the system's file manager, which is opened on a thread."""
        status = next((one for one in self.statuses if one.export_id == export_id), None)
        if status is None or status.result is None:
            return
        path = status.result.path

        def work(context: JobContext) -> None:
            self._show(path)

        def fail(error: Exception) -> None:
            self._notices.add_failure("The folder could not be shown", error)

        self._jobs.start("Show in folder", work, lambda _: None, fail)

    def poll(self) -> bool:
        """Take in finished work, and begin the next. Whether anything changed."""
        has_news = self._jobs.poll()
        ended = self._queue.poll(n_threads=1 if self._is_training() else None)
        for status in ended:
            if status.state == "failed":
                self._notices.add("error", f"{status.title} was not exported", status.message, status.hint)
        return bool(ended) or has_news

    def close(self) -> None:
        """End the running export; its unfinished files disappear."""
        self._queue.close()
        self._jobs.close()
        self._planner.close(timeout_s=0.5)
        self._namer.close(timeout_s=0.5)

    # ---- on the planner's thread

    def _plan(self, wish: _Wish) -> ExportPlan:
        from app.evaluation.headless import open_trained

        opened, key = self._opened, (wish.generation, wish.context.trained)
        assert opened is not None
        if self._settled != wish.n_asked:
            self._settle()
            self._settled = wish.n_asked
        if self._read is None or self._read[0] != key:
            try:
                self._read = key, open_trained(opened.project, opened.capture)
            except EngineError as error:
                return ExportPlan(wish.choices, problems=(str(error),))
        return plan_export(self._read[1], wish.context, wish.choices, wish.taken)


def _name(wish: _Wish) -> str:
    return suggested_out(wish.folder, wish.context, wish.choices, wish.taken)


def _context(
    opened: OpenedProject, timeline: Timeline, trained: tuple[int, ...], paths: tuple[str, ...]
) -> ExportContext:
    capture = opened.capture
    first, last = timeline.in_frame, timeline.out_frame
    return ExportContext(
        name=project_name(opened.project.folder.absolute(), opened.project.settings.capture),
        n_frames=capture.n_frames,
        clips=tuple((clip.start, clip.stop) for clip in opened.clips),
        trained=trained,
        frame_index=timeline.frame_index,
        in_frame=0 if first is None else first,
        out_frame=timeline.last_frame if last is None else last,
        cameras=tuple(capture.rig.names),
        picture_size=capture.picture_size,
        fps=capture.fps,
        paths=paths,
        has_timing=bool(opened.project.document.timing),
        has_edits=any(edit.is_on for edit in opened.project.document.edits),
        has_videos=any(isinstance(entry.source, VideoFrames) for entry in capture.layout.cameras),
    )
