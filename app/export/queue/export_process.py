"""ExportProcess: the window's side of a process that exports: hear from it, cancel it, notice its death.

Whatever a process that was killed has left unfinished is removed before its end is reported.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from app.export.export_progress import ExportProgress, ExportResult
from app.export.queue.export_jobs import ExportTask
from app.export.queue.export_messages import Ending, Event, ExportDone, ExportFailed, ExportGoesOn, ExportStopped
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import ChildProcess
from engine.errors import EngineError
from engine.storage.files import discard, partials_of

HINT = "Nothing was left behind. Try again; the log may say more."
EXPORTING: ChildKind[ExportTask, ExportProgress, ExportResult] = ChildKind(
    place="app.export.queue.export_process:EXPORTING",
    work="app.export.queue.export_worker:main",
    what="The process that exports",
    job=ExportTask,
    event=ExportProgress,
    result=ExportResult,
    grace_s=6.0,  # a module that is being imported is imported first
)


class Exporter(Protocol):
    """Something that carries out one task, wherever that happens."""

    def poll(self) -> list[Event]:
        """Events since the last call. The last one ever is an Ending."""
        ...

    def cancel(self) -> None:
        """End soon and leave nothing behind; the ending follows in `poll`."""
        ...

    def end(self) -> None:
        """End at once and leave nothing behind. Blocks for a moment; may be called twice."""
        ...


class ExportProcess:
    """A process of its own. See `Exporter`.

    Args:
        task: The export to run.

    Attributes:
        child: The process.
    """

    def __init__(self, task: ExportTask) -> None:
        folder = task.job.out.absolute().parent
        self.child = ChildProcess(EXPORTING, task, sweep=lambda pid: _sweep(folder, pid))
        self._cancelled_s: float | None = None
        self._has_ended = False

    def poll(self) -> list[Event]:
        """See `Exporter`."""
        if self._has_ended:
            return []
        is_over = self._has_ended = self.child.is_over
        events: list[Event] = [ExportGoesOn(progress) for progress in self.child.poll()]
        if is_over:
            events.append(self._ending())
        elif self._cancelled_s is not None and time.monotonic() - self._cancelled_s > EXPORTING.grace_s:
            self.child.kill()
        return events

    def cancel(self) -> None:
        """See `Exporter`."""
        self._cancelled_s = self._cancelled_s or time.monotonic()
        self.child.ask_to_end()

    def end(self) -> None:
        """See `Exporter`."""
        self.cancel()
        self.child.end()

    def _ending(self) -> Ending:
        try:
            return ExportDone(self.child.result())
        except EngineError as error:
            return ExportFailed(*error.parts())
        except ChildFailed as error:
            return ExportFailed(f"{error}.", HINT) if self._cancelled_s is None else ExportStopped()


def _sweep(folder: Path, pid: int) -> None:
    """Remove what a process had begun to write and did not finish, as it does itself unless it is killed."""
    for path in _left_over(folder, pid):
        discard(path)


def _left_over(folder: Path, pid: int) -> list[Path]:
    with suppress(OSError):
        return partials_of(folder, pid)
    return []
