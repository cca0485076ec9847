"""MeasuringProcess: the window's side of the process that measures: start it, talk to it, notice its death, end it."""

from __future__ import annotations

import multiprocessing
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

    Args:
        job: What to measure.
    """

    def __init__(self, job: MeasureJob) -> None:
        context = multiprocessing.get_context("spawn")
        child_commands, self._commands = context.Pipe(duplex=False)
        self._events, child_events = context.Pipe(duplex=False)
        self.process = context.Process(
            target=main, args=(job, child_commands, child_events), name="measuring", daemon=True
        )
        with undisturbed():
            self.process.start()
        child_commands.close()  # the child has its own; ours would hide its end
        child_events.close()
        self._has_ended = False

    def send(self, command: Command) -> None:
        """See `Measurer`."""
        with suppress(OSError):
            self._commands.send_bytes(encode(command))

    def poll(self) -> list[Event]:
        """See `Measurer`."""
        if self._has_ended:
            return []
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
        if self.process.is_alive():
            self.process.kill()
        self.process.join(0.2)
        self._commands.close()
        self._events.close()
