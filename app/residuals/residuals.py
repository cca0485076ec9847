"""Residuals: differences of the open project from the captured pictures: maps of the picture at the playhead, heat of
anchors, and figures of every picture, measured in the background.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from app.background.latest import LatestWorker
from app.playback.playback import Failure, Playback
from app.playback.timeline import Timeline
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.residuals.anchor_heat import AnchorHeat, AnchorHeats
from app.residuals.clip_pictures import ClipPictures
from app.residuals.heat import Heat, HeatRequest
from app.residuals.heat_map import HeatMap
from app.residuals.measuring import BackgroundMeasuring
from app.residuals.measuring_process import LaunchMeasuring, MeasuringProcess
from app.status import ResidualStatus
from engine.errors import EngineError, ProjectError


class Residuals:
    """Residuals of the open project. For one thread, and nothing here waits.

    Args:
        playback: Of the session.
        launch: Starts the process that measures.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        playback: Playback,
        *,
        launch: LaunchMeasuring = MeasuringProcess,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._pictures = ClipPictures(playback.decoder)
        self._heat = Heat(playback, self._pictures, self._why_none)
        self._anchors = AnchorHeats(playback, self._pictures, self._why_none)
        self.measuring = BackgroundMeasuring(launch=launch, clock=clock)
        self._opened: OpenedProject | None = None
        self._catalog: ClipCatalog | None = None
        self._seen = self._finished

    def open(self, opened: OpenedProject, catalog: ClipCatalog) -> None:
        """Take up a project, or the same one with other settings; `Playback.show` comes first."""
        if self._opened is None or self._opened.generation != opened.generation:
            self._heat.clear()
            self._anchors.clear()
            self._pictures.clear()
        self._opened, self._catalog = opened, catalog
        self.measuring.open(opened, catalog)

    def heat(self, timeline: Timeline, camera_index: int, kind: str) -> HeatMap | None:
        """The map of a camera's picture at the playhead; see Heat.heat."""
        return None if self._opened is None else self._heat.heat(self._opened, timeline, camera_index, kind)

    def anchor_heat(self, timeline: Timeline, column: str) -> AnchorHeat | None:
        """Heat of the anchors at the playhead; see AnchorHeats.anchor_heat."""
        return None if self._opened is None else self._anchors.anchor_heat(self._opened, timeline, column)

    def look_at(self, timeline: Timeline, camera_index: int | None) -> None:
        """Set what the user looks at, and ask for figures; see Measuring.look_at."""
        self.measuring.look_at(timeline, camera_index)

    @property
    def status(self) -> ResidualStatus:
        """Progress of the measuring."""
        return self.measuring.status

    def poll(self, *, is_busy: bool) -> bool:
        """Take in finished work of threads and process. Returns whether something visible changed."""
        has_changed = self.measuring.poll(is_busy=is_busy)
        seen = self._finished
        has_changed |= seen != self._seen
        self._seen = seen
        return has_changed

    def take_failures(self) -> list[Failure]:
        """Failures since the last call. Those of a live state are not reported: another one follows."""
        found = []
        for worker in self._workers:
            failure = worker.take_error()
            if failure is None:
                continue
            request, error = failure
            reason = error.message if isinstance(error, EngineError) else str(error)
            if isinstance(request, HeatRequest):
                self._heat.note_failure(request, reason)
            else:
                self._anchors.note_failure(request, reason)
            if not any(state is not None and state.is_live for state in request.states):
                found.append(Failure("The residual cannot be shown", error, isinstance(error, ProjectError)))
        return found

    def close(self) -> None:
        """End threads and process."""
        self.measuring.close()
        for part in (self._heat, self._anchors):
            part.close()

    def _why_none(self, clip_index: int) -> str:
        state = "untrained" if self._catalog is None else self._catalog[clip_index].state
        words = {"damaged": "is damaged", "stale": "is out of date"}.get(state, "is not trained")
        return f"clip {clip_index} {words}"

    @property
    def _workers(self) -> tuple[LatestWorker[Any, Any], ...]:
        return (self._heat.worker, self._anchors.worker)

    @property
    def _finished(self) -> tuple[object, ...]:
        return tuple(None if worker.newest is None else worker.newest[0] for worker in self._workers)
