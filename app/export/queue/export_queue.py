"""ExportQueue: exports that wait, the one that runs, and those that have ended. One at a time; nothing here blocks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.export.export_plan import TAKEN, overlap
from app.export.queue.export_jobs import ExportTask
from app.export.queue.export_messages import Event, ExportDone, ExportFailed, ExportGoesOn
from app.export.queue.export_process import Exporter, ExportProcess
from app.export.queue.export_status import ExportStatus
from app.training.rate import SmoothedRate
from engine.errors import ProjectError

MAX_ENDED = 50
"""Exports that have ended and are still listed."""


class ExportQueue:
    """Changed by its methods and `poll` only, on one thread.

    Attributes:
        revision: Goes up with every change.

    Args:
        launch: Starts a task; a process by default.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        *,
        launch: Callable[[ExportTask], Exporter] = ExportProcess,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.revision = 0
        self._launch, self._clock = launch, clock
        self._statuses: list[ExportStatus] = []
        self._tasks: dict[int, ExportTask] = {}
        self._exporter: Exporter | None = None
        self._running_id: int | None = None
        self._rate, self._started_s = SmoothedRate(), 0.0
        self._n_added = 0

    @property
    def statuses(self) -> tuple[ExportStatus, ...]:
        """In the order of the list: what runs, what waits, in the order in which it will run, and what has ended,
        newest first."""
        live = [status for status in self._statuses if not status.is_over]
        return (*live, *reversed([status for status in self._statuses if status.is_over]))

    @property
    def is_busy(self) -> bool:
        """Whether something runs or waits."""
        return any(not status.is_over for status in self._statuses)

    @property
    def targets(self) -> tuple[Path, ...]:
        """Paths that running and waiting exports will write, absolute."""
        return tuple(status.path.absolute() for status in self._statuses if not status.is_over)

    def add(self, task: ExportTask, title: str) -> int:
        """Put a task at the end; returns its number.

        Raises:
            ProjectError: Another one that runs or waits writes to the same place.
        """
        self._check_free(task.job.out)
        self._n_added += 1
        self._tasks[self._n_added] = task
        words = title or task.job.title
        self._statuses.append(ExportStatus(self._n_added, words, task.job.out, project=Path(task.project)))
        self.revision += 1
        return self._n_added

    def cancel(self, export_id: int) -> None:
        """End one that runs, or let one that waits never begin. What it began to write disappears."""
        status = self._find(export_id)
        if status is None or status.is_over:
            return
        if export_id == self._running_id and self._exporter is not None:
            self._exporter.cancel()
            self._set(export_id, state="stopping")
        else:
            self._set(export_id, state="cancelled")

    def remove(self, export_id: int) -> None:
        """Take one that does not run out of the list; what it has written stays."""
        if export_id != self._running_id:
            self._statuses = [status for status in self._statuses if status.export_id != export_id]
            self._tasks.pop(export_id, None)
            self.revision += 1

    def move(self, export_id: int, place: int) -> None:
        """Bring one that waits to a place among those that wait, 0 being the next."""
        status = self._find(export_id)
        if status is None or status.state != "waiting":
            return
        waiting = [one for one in self._statuses if one.state == "waiting" and one is not status]
        waiting.insert(min(max(place, 0), len(waiting)), status)
        self._statuses = [one for one in self._statuses if one.state != "waiting"] + waiting
        self.revision += 1

    def retry(self, export_id: int) -> None:
        """Begin one that failed or was cancelled anew, after those that wait. Raises as `add` does."""
        status = self._find(export_id)
        if status is not None and status.state in ("failed", "cancelled"):
            self._check_free(status.path)
            self._statuses.remove(status)
            self._statuses.append(ExportStatus(export_id, status.title, status.path, project=status.project))
            self.revision += 1

    def poll(self, *, n_threads: int | None = None) -> list[ExportStatus]:
        """Take in what the running export reports, and start the next one. Never blocks.

        Args:
            n_threads: Threads of an export that begins now; None for all cores.
        Returns:
            Those that have ended since the last call.
        """
        ended: list[ExportStatus] = []
        if self._exporter is not None and self._running_id is not None:
            for event in self._exporter.poll():
                self._take(self._running_id, event)
            status = self._find(self._running_id)
            assert status is not None
            if status.is_over:
                ended.append(status)
                self._exporter = self._running_id = None
                self._forget_old()
        if self._exporter is None:
            self._start(n_threads)
        return ended

    def close(self) -> None:
        """End the running export; no waiting one begins."""
        if self._exporter is not None:
            self._exporter.end()
            self._exporter = self._running_id = None
        self._statuses = [status for status in self._statuses if status.is_over]

    def _start(self, n_threads: int | None) -> None:
        status = next((status for status in self._statuses if status.state == "waiting"), None)
        if status is None:
            return
        self._running_id = status.export_id
        self._rate, self._started_s = SmoothedRate(), self._clock()
        self._exporter = self._launch(replace(self._tasks[status.export_id], n_threads=n_threads))
        self._statuses.remove(status)
        n_not_waiting = sum(one.state != "waiting" for one in self._statuses)
        self._statuses.insert(n_not_waiting, replace(status, state="running"))
        self.revision += 1

    def _take(self, export_id: int, event: Event) -> None:
        seconds = self._clock() - self._started_s
        match event:
            case ExportGoesOn(progress=progress):
                self._rate.update(progress.n_done, self._clock())
                eta_s = self._rate.eta_s(progress.n_all - progress.n_done) if progress.n_all else None
                self._set(export_id, progress=progress, per_s=self._rate.per_s, eta_s=eta_s)
            case ExportDone(result=result):
                self._set(export_id, state="done", result=result, seconds=seconds, eta_s=None)
            case ExportFailed(message=message, hint=hint):
                self._set(export_id, state="failed", message=message, hint=hint, seconds=seconds, eta_s=None)
            case _:
                self._set(export_id, state="cancelled", seconds=seconds, eta_s=None)

    def _check_free(self, path: Path) -> None:
        if any(overlap(path.absolute(), other) for other in self.targets):
            raise ProjectError(TAKEN, hint="Wait for it, or choose another name.", path=path)

    def _find(self, export_id: int) -> ExportStatus | None:
        return next((status for status in self._statuses if status.export_id == export_id), None)

    def _set(self, export_id: int, **changes: object) -> None:
        self._statuses = [
            replace(status, **changes) if status.export_id == export_id else status  # type: ignore[arg-type]
            for status in self._statuses
        ]
        self.revision += 1

    def _forget_old(self) -> None:
        over = [status for status in self._statuses if status.is_over]
        for status in over[:-MAX_ENDED]:
            self.remove(status.export_id)
