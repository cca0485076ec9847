"""ExportTask: a job with the project that it is of, and what carries it out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Union

from app.export.export_progress import ExportResult, Report
from app.export.jobs.job import ExportJob
from app.export.jobs.table import KINDS
from engine.backends.table import chosen_name

if TYPE_CHECKING:
    AnyJob = ExportJob
else:  # one of the kinds, which another process knows by its name
    AnyJob = Union[tuple(KINDS.values())]  # noqa: UP007


@dataclass(frozen=True, slots=True)
class ExportTask:
    """Everything that a process needs.

    Attributes:
        job: The export's declaration.
        project: Folder.
        capture, scale, frames, follow_links: The way its capture is opened; the project may still name another place.
        n_threads: To compute with; None for all cores.
        backend: Name of the back end.
    """

    job: AnyJob
    project: str
    capture: str
    scale: float
    frames: tuple[int, int] | None
    follow_links: bool
    n_threads: int | None = None
    backend: str = field(default_factory=chosen_name)


def run_task(task: ExportTask, report: Report) -> ExportResult:
    """Open the project and run the job, on this thread.

    Raises:
        EngineError: It cannot be opened or written.
    """
    from app.evaluation.headless import open_trained
    from app.project.opening.project_access import open_project
    from engine.capture.capture import open_capture

    project = open_project(Path(task.project), is_writable=False)
    capture = open_capture(
        task.capture,
        scale=task.scale,
        frames=task.frames,
        follow_links=task.follow_links,
        is_growing=project.settings.is_growing,
    )
    try:
        return task.job.load().run(open_trained(project, capture), task.job, report)
    finally:
        capture.close()
