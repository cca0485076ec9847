"""InlineWorker: the same messages without a process; steps run inside poll(). For tests and debugging."""

from __future__ import annotations

import time
from collections import deque
from pathlib import Path

from app.training.messages import ENDINGS, Command, Event, Stop, TrainJob
from app.training.worker.build import build_training
from app.training.worker.folder_store import FolderStore
from app.training.worker.interface import MakeTraining
from app.training.worker.run import TrainingRun
from engine.children.messages import decoded, encoded


class InlineWorker:
    """Runs the loop on the caller's thread. Messages are encoded and decoded all the same.

    Args:
        job: What to train.
        folder: Of the project.
        make_training: Builds the training.
        budget_s: Each poll steps for about this long, at least once.
    """

    def __init__(
        self, job: TrainJob, folder: Path, make_training: MakeTraining = build_training, *, budget_s: float = 0.0
    ) -> None:
        self.job = job
        self._commands: deque[bytes] = deque()
        self._events: deque[bytes] = deque()
        self._budget_s = budget_s
        self._is_running = True
        self._run = TrainingRun(
            job,
            lambda: FolderStore(folder, claim=job.claim),
            receive=self._receive,
            send=self._send,
            make_training=make_training,
            can_wait=False,
        )

    def _receive(self, wait_s: float) -> Command | None:
        return decoded(self._commands.popleft(), Command) if self._commands else None

    def _send(self, event: Event) -> None:
        self._events.append(encoded(event))

    def send(self, command: Command) -> None:
        """See `process.Worker`."""
        self._commands.append(encoded(command))

    def poll(self) -> list[Event]:
        """See `process.Worker`. Does one step or more."""
        until_s = time.monotonic() + self._budget_s
        while self._is_running:
            self._is_running = self._run.advance()
            if time.monotonic() >= until_s:
                break
        events = [decoded(data, Event) for data in self._events]
        self._events.clear()
        if any(isinstance(event, ENDINGS) for event in events):
            self._is_running = False
        return events

    def close(self, *, timeout_s: float) -> None:
        """See `process.Worker`."""
        if self._is_running:
            self.send(Stop(keep=True))
            while self._is_running:
                self._is_running = self._run.advance()
