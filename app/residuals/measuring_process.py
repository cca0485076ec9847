"""MeasuringProcess: the window's side of the process that measures: start it, talk to it, notice its death, end it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from app.residuals.measuring_messages import Command, Event, MeasureJob, MeasuringEnded, Trouble
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import MAX_EVENTS_PER_POLL, ChildProcess
from engine.errors import EngineError

KEPT = "Measurements are kept; measuring resumes when a clip is trained or the project is opened again."
MEASURING: ChildKind[MeasureJob, Event, None] = ChildKind(
    place="app.residuals.measuring_process:MEASURING",
    work="app.residuals.measuring_worker:main",
    what="The process that measures",
    job=MeasureJob,
    event=Event,
    command=Command,
    priority="idle",
)


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
    """A separate process. See `Measurer`.

    Args:
        job: The figures to measure.
    """

    def __init__(self, job: MeasureJob) -> None:
        self.child = ChildProcess(MEASURING, job)
        self._has_ended = False

    def send(self, command: Command) -> None:
        """See `Measurer`."""
        self.child.send(command)

    def poll(self) -> list[Event]:
        """See `Measurer`."""
        if self._has_ended:
            return []
        is_over = self.child.is_over
        events = self.child.poll()
        if is_over and len(events) < MAX_EVENTS_PER_POLL:
            self._has_ended = True
            try:
                self.child.result()
            except (ChildFailed, EngineError) as error:
                events.append(Trouble(f"{error}. {KEPT}"))
            events.append(MeasuringEnded())
        return events

    def end(self) -> None:
        """See `Measurer`. Figures are written whole, one by one, so that only the present one is lost."""
        self._has_ended = True
        self.child.ask_to_end()
        self.child.kill()
