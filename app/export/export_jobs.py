"""The kinds of exports and what runs each of them: one table for the window's queue.

A kind is a module with two functions, which is imported once it is needed:

    estimate(opened, job) -> ExportEstimate   quick, reads no more than headers; raises EngineError where it cannot be
    run(opened, job, report) -> ExportResult  does the work; what `report` raises ends it, and then nothing is left

A job is a frozen value that can be pickled: plain names, numbers, paths and ranges. `job.out` is the file or folder.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

from app.export.export_progress import ExportEstimate, ExportResult, Report

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject


class Job(Protocol):
    """What is common to the jobs of all kinds."""

    @property
    def out(self) -> Path:
        """The file or folder to write."""
        ...


class JobModule(Protocol):
    """What the module of a kind provides."""

    def estimate(self, opened: TrainedProject, job: Any) -> ExportEstimate:
        """What will be written. Raises EngineError where it cannot be."""
        ...

    def run(self, opened: TrainedProject, job: Any, report: Report) -> ExportResult:
        """Write it. Raises EngineError, and what `report` raises."""
        ...


class ExportKind(NamedTuple):
    """One row.

    Attributes:
        title: As the user reads it.
        module: Where its work is.
    """

    title: str
    module: str

    def load(self) -> JobModule:
        """Import the module."""
        return cast("JobModule", importlib.import_module(self.module))


KINDS: dict[str, ExportKind] = {
    "gaussians": ExportKind("Gaussians", "app.export.gaussians_job"),
    "video": ExportKind("Video", "app.export.video.video_export"),
    "player": ExportKind("Player", "app.export.player_job"),
    "metrics": ExportKind("Metrics", "app.export.metrics_job"),
    "cameras": ExportKind("Cameras", "app.export.cameras_job"),
}
"""Every kind of export, in the order in which they are offered."""


@dataclass(frozen=True, slots=True)
class ExportTask:
    """A job with the project that it is of: everything that a process needs.

    Attributes:
        kind: One of KINDS.
        job: Of this kind.
        project: Folder.
        capture, scale, frames, follow_links: How its capture is opened; the project may still name another place.
        n_threads: To compute with; None for all cores.
    """

    kind: str
    job: Job
    project: str
    capture: str
    scale: float
    frames: tuple[int, int] | None
    follow_links: bool
    n_threads: int | None = None


def run_task(task: ExportTask, report: Report) -> ExportResult:
    """Open the project and run the job, on this thread.

    Raises:
        EngineError: It cannot be opened or written.
    """
    from app.evaluation.headless import open_trained
    from app.project.project import open_project
    from engine.capture.capture import open_capture

    project = open_project(Path(task.project), is_writable=False)
    capture = open_capture(task.capture, scale=task.scale, frames=task.frames, follow_links=task.follow_links)
    try:
        return KINDS[task.kind].load().run(open_trained(project, capture), task.job, report)
    finally:
        capture.close()
