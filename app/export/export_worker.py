"""The process that exports: runs one job, tells how far it is, and listens whether it is still wanted.

Nothing imported here may draw anything. It has the lowest priority, so that the window and trainings come first.
"""

from __future__ import annotations

import logging
import os
import signal
import time
from contextlib import suppress
from multiprocessing.connection import Connection

from app.background.kernels import use_threads
from app.background.logs import start_logging
from app.export.export_jobs import ExportTask, run_task
from app.export.export_messages import ExportDone, ExportFailed, ExportGoesOn, ExportStopped, encode
from app.export.export_progress import ExportCancelled, ExportProgress
from engine.backends.table import choose_backend
from engine.children.priority import IDLE_NICENESS, lower_process
from engine.errors import EngineError
from engine.kernels.cache import use_kernel_cache

logger = logging.getLogger(__name__)

TELL_EVERY_S = 0.25
"""Nobody reads faster, and each time the window is drawn, which takes cores where there is no graphics processor."""


def main(task: ExportTask, commands: Connection, events: Connection) -> None:
    """Runs in the child until the job has ended."""
    lower_process(IDLE_NICENESS)  # before any thread is started, since threads take over the priority
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches the whole group; the parent decides what it means
    if task.n_threads is not None:
        os.environ["NUMBA_NUM_THREADS"] = str(task.n_threads)  # of whatever asks for all cores, too
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(task.n_threads)
    choose_backend(task.backend)
    with suppress(OSError):  # nobody listens any more
        events.send_bytes(encode(_ending(task, Wanted(commands, events))))


def _ending(task: ExportTask, wanted: Wanted) -> ExportDone | ExportStopped | ExportFailed:
    try:
        wanted.report(ExportProgress(0, 0, message="Opening the project"))
        return ExportDone(run_task(task, wanted.report))
    except ExportCancelled:
        return ExportStopped()
    except EngineError as error:
        return ExportFailed(*error.parts())
    except MemoryError:
        return ExportFailed("There is not enough memory.", "Close other programs, or export fewer frames at a time.")
    except Exception as error:  # the edge of the process
        logger.exception("export failed")
        return ExportFailed(f"Export failed ({type(error).__name__}: {error}).", "See the log for details.")


class Wanted:
    """Tells the window's process how far the job is, and raises once that does not want it any more."""

    def __init__(self, commands: Connection, events: Connection) -> None:
        self._commands, self._events = commands, events
        self._told_s = -TELL_EVERY_S

    def report(self, progress: ExportProgress) -> None:
        """See `Report`. Raises ExportCancelled when it was cancelled, or when nobody listens any more."""
        try:
            if self._commands.poll(0):
                self._commands.recv_bytes()  # there is but one command; the end of the pipe raises
                raise ExportCancelled
            now_s = time.monotonic()
            if now_s - self._told_s >= TELL_EVERY_S or progress.n_done == progress.n_all:
                self._told_s = now_s
                self._events.send_bytes(encode(ExportGoesOn(progress)))
        except (OSError, EOFError) as error:
            raise ExportCancelled from error
