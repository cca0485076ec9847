"""MeasuringProcess: the window's side of the process that measures: start it, talk to it, notice its death, end it."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import msgspec

from app.background.children import undisturbed
from app.residuals.measuring_messages import (
    Command,
    Event,
    MeasureJob,
    MeasuringEnded,
    Trouble,
    decode_event,
    encode,
)
from app.residuals.measuring_worker import main

MAX_EVENTS_PER_POLL = 200
"""A window that slept must not spend a whole frame on old figures."""
END_TIMEOUT_S = 0.05
"""A killed process is gone in a few milliseconds; one that is not is collected later."""
DIED = (
    "The process that measures ended unexpectedly. What was measured is kept; measuring goes on when a clip is trained"
)
DIED += " or the project is opened again."


class Measurer(Protocol):
    """Something that measures a job, wherever that happens."""

    def send(self, command: Command) -> None:
        """Never blocks and never fails."""
        ...

    def poll(self) -> list[Event]:
        """Events since the last call. The last one ever is MeasuringEnded."""
        ...

    def end(self) -> None:
        """End at once. Never blocks for long; may be called twice."""
        ...


LaunchMeasuring = Callable[[MeasureJob], Measurer]


class MeasuringProcess:
    """A spawned process. See `Measurer`.

    It is started on a thread: the job of a long project does not fit into a pipe at once, so that who starts it
    waits until the process is far enough to read.

    Args:
        job: What to measure.
    """

    def __init__(self, job: MeasureJob) -> None:
        context = multiprocessing.get_context("spawn")
        self._child_commands, self._commands = context.Pipe(duplex=False)
        self._events, self._child_events = context.Pipe(duplex=False)
        self.process = context.Process(
            target=main, args=(job, self._child_commands, self._child_events), name="measuring", daemon=True
        )
        self._has_ended = self._is_unwanted = False
        self._failure = ""
        self._lock = threading.Lock()
        self._starter = threading.Thread(target=self._start, name="start measuring", daemon=True)
        self._starter.start()

    def _start(self) -> None:
        try:
            with undisturbed():
                self.process.start()
        except OSError as error:
            self._failure = f"Pictures cannot be measured in the background ({error.strerror or error})."
        self._child_commands.close()  # the child has its own; ours would hide its end
        self._child_events.close()
        with self._lock:
            if self._is_unwanted:
                self._finish()

    def send(self, command: Command) -> None:
        """See `Measurer`."""
        with suppress(OSError):
            self._commands.send_bytes(encode(command))

    def poll(self) -> list[Event]:
        """See `Measurer`."""
        if self._has_ended or self._starter.is_alive():
            return []
        if self._failure:
            self._has_ended = True
            return [Trouble(self._failure), MeasuringEnded()]
        is_alive = self.process.is_alive()  # asked before the pipe is drained, so that last words are not missed
        events: list[Event] = []
        with suppress(EOFError, OSError, msgspec.DecodeError):
            while len(events) < MAX_EVENTS_PER_POLL and self._events.poll():
                events.append(decode_event(self._events.recv_bytes()))
        if any(isinstance(event, MeasuringEnded) for event in events):
            self._has_ended = True
        elif not is_alive and len(events) < MAX_EVENTS_PER_POLL:
            self._has_ended = True
            events += [Trouble(DIED), MeasuringEnded()]
        return events

    def end(self) -> None:
        """See `Measurer`. Figures are written whole, one by one, so that nothing but the one at hand is lost."""
        self._has_ended = True
        with self._lock:
            if not self._is_unwanted:
                self._is_unwanted = True
                if not self._starter.is_alive():
                    self._finish()

    def _finish(self) -> None:
        if self.process.pid is not None:
            self.process.kill()
            self.process.join(END_TIMEOUT_S)
        self._commands.close()
        self._events.close()
