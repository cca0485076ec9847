"""ProcessWorker: the window's side of one worker process: start it, talk to it, notice its death, end it."""

from __future__ import annotations

import multiprocessing
from contextlib import suppress
from typing import Protocol

from app.background.children import start_child
from app.background.logs import tail
from app.project.project import Project
from app.training.build import build_training
from app.training.interface import MakeTraining
from app.training.messages import ENDINGS, Command, Event, Stop, TrainJob, WorkerDied, decode, encode
from app.training.worker import main

MAX_EVENTS_PER_POLL = 200
"""A window that slept must not spend a whole frame on old reports."""


class Worker(Protocol):
    """One clip being trained, wherever that happens."""

    @property
    def job(self) -> TrainJob:
        """What it trains."""
        ...

    def send(self, command: Command) -> None:
        """Never blocks and never fails; a dead worker is noticed by `poll`."""
        ...

    def poll(self) -> list[Event]:
        """Events since the last call. The last one ever is an ending; a death is one."""
        ...

    def close(self, *, timeout_s: float) -> None:
        """End it for certain, keeping what was learned when there is time for it."""
        ...


class ProcessWorker:
    """A spawned process. See `Worker`.

    Args:
        job: What to train.
        project: For the log file.
        make_training: Builds the training in the child; has to be importable there.
    """

    def __init__(self, job: TrainJob, project: Project, make_training: MakeTraining = build_training) -> None:
        self.job = job
        self._log_path = project.log_path(job.clip_index)
        self._has_ended = False
        context = multiprocessing.get_context("spawn")
        child_commands, self._commands = context.Pipe(duplex=False)
        self._events, child_events = context.Pipe(duplex=False)
        self.process = context.Process(
            target=main,
            args=(encode(job), child_commands, child_events, str(self._log_path), make_training),
            name=f"clip {job.clip_index}",
            daemon=True,
        )
        start_child(self.process)
        child_commands.close()  # the child has its own; ours would hide its end
        child_events.close()

    def send(self, command: Command) -> None:
        """See `Worker`."""
        with suppress(OSError):
            self._commands.send_bytes(encode(command))

    def poll(self) -> list[Event]:
        """See `Worker`."""
        if self._has_ended:
            return []
        is_alive = self.process.is_alive()  # asked before the pipe is drained, so that last words are not missed
        events: list[Event] = []
        with suppress(EOFError, OSError):
            while len(events) < MAX_EVENTS_PER_POLL and self._events.poll():
                events.append(decode(self._events.recv_bytes()))  # type: ignore[arg-type]
        if any(isinstance(event, ENDINGS) for event in events):
            self._has_ended = True
        elif not is_alive and len(events) < MAX_EVENTS_PER_POLL:
            self._has_ended = True
            self.process.join(1.0)
            events.append(WorkerDied(self.process.exitcode, tail(self._log_path)))
        return events

    def close(self, *, timeout_s: float) -> None:
        """See `Worker`. Asks, waits, then terminates, then kills."""
        if self.process.is_alive():
            self.send(Stop(keep=True))
            self._drain_until_end(timeout_s)
        if self.process.is_alive():
            self.process.terminate()
            self.process.join(2.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join(2.0)
        self._commands.close()
        self._events.close()
        self._has_ended = True

    def _drain_until_end(self, timeout_s: float) -> None:
        """Wait for the process while reading what it says, so that a full pipe cannot hold it up."""
        n_slices = max(int(timeout_s / 0.05), 1)
        for _ in range(n_slices):
            with suppress(EOFError, OSError):
                while self._events.poll():
                    self._events.recv_bytes()
            self.process.join(0.05)
            if not self.process.is_alive():
                return
