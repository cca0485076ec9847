"""ExportProcess: the window's side of a process that exports: start it, hear from it, cancel it, notice its death.

A thread waits for the process, so that `poll`, `cancel` and `end` never block. Whatever a process that was killed has
left unfinished is removed before its end is told.
"""

from __future__ import annotations

import logging
import multiprocessing
import queue
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import msgspec

from app.background.children import start_child
from app.export.export_jobs import ExportTask
from app.export.export_messages import (
    CANCEL,
    Ending,
    Event,
    ExportFailed,
    ExportGoesOn,
    ExportStopped,
    decode_event,
)
from app.export.export_worker import main
from engine.storage.files import PARTIAL_PREFIX, discard

logger = logging.getLogger(__name__)

LISTEN_S = 0.1
GRACE_S = 6.0
"""A process that was cancelled tidies up for so long before it is killed: what it loads just now is loaded first."""
HINT = "No files were left. Try again; see the log for details."


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
    """A spawned process. See `Exporter`.

    Args:
        task: What to export.
        grace_s: How long a cancelled process may take to tidy up.
    """

    def __init__(self, task: ExportTask, *, grace_s: float = GRACE_S) -> None:
        self._grace_s = grace_s
        self._folder = task.job.out.absolute().parent
        context = multiprocessing.get_context("spawn")
        self._child_commands, self._commands = context.Pipe(duplex=False)
        self._events, self._child_events = context.Pipe(duplex=False)
        arguments = (task, self._child_commands, self._child_events)
        self.process = context.Process(target=main, args=arguments, name="export", daemon=True)
        self._news: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._is_unwanted, self._is_urgent = threading.Event(), threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="watch export", daemon=True)
        self._watcher.start()

    def poll(self) -> list[Event]:
        """See `Exporter`."""
        events: list[Event] = []
        with suppress(queue.Empty):
            while True:
                events.append(self._news.get_nowait())
        return events

    def cancel(self) -> None:
        """See `Exporter`."""
        self._is_unwanted.set()

    def end(self, timeout_s: float = 2.0) -> None:
        """See `Exporter`."""
        self._is_unwanted.set()
        self._is_urgent.set()
        self._watcher.join(timeout_s)

    # ---------------------------------------------------------------- on the thread

    def _watch(self) -> None:
        try:
            start_child(self.process)
        except OSError as error:
            self._news.put(ExportFailed(f"No process could be started ({error.strerror or error}).", HINT))
            return
        finally:
            self._child_commands.close()  # the child has its own; ours would hide its end
            self._child_events.close()
        ending = self._listen()
        if ending is None:
            self.process.kill()
            self.process.join()
            self._sweep()
            ending = ExportStopped() if self._is_unwanted.is_set() else self._death()
        self._news.put(ending)
        self._commands.close()
        self._events.close()
        while self.process.is_alive():  # libraries are unloaded; nothing comes of it any more
            if self._is_urgent.wait(LISTEN_S):
                self.process.kill()
            self.process.join(LISTEN_S)

    def _listen(self) -> Ending | None:
        """Pass on what the process says until it ends; None where it did not say how."""
        cancelled_s: float | None = None
        has_begun = False
        while True:
            if self._is_unwanted.is_set():
                if not has_begun:  # it is still being loaded, and has written nothing
                    return None
                if cancelled_s is None:
                    cancelled_s = time.monotonic()
                    with suppress(OSError):
                        self._commands.send_bytes(CANCEL)
                if self._is_urgent.is_set() or time.monotonic() - cancelled_s > self._grace_s:
                    return None
            try:
                if not self._events.poll(LISTEN_S):
                    continue
                event = decode_event(self._events.recv_bytes())
            except (EOFError, OSError, msgspec.DecodeError):
                return None
            has_begun = True
            if not isinstance(event, ExportGoesOn):
                return event
            self._news.put(event)

    def _sweep(self) -> None:
        """Remove what the process had begun to write and did not finish, as it does itself unless it is killed."""
        for path in _left_over(self._folder, self.process.pid):
            discard(path)

    def _death(self) -> ExportFailed:
        code = self.process.exitcode or 0
        reason = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
        memory = ", perhaps because memory ran out" if code == -9 else ""
        return ExportFailed(f"The process that exports {reason}{memory}.", HINT)


def _left_over(folder: Path, pid: int | None) -> list[Path]:
    with suppress(OSError):
        return [path for path in folder.iterdir() if path.name.startswith(f"{PARTIAL_PREFIX}{pid}-")]
    return []
