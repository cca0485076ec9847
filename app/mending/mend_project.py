"""Mending a project in a separate process, then putting its clips in place. For a window and the command line.

    jobs.start("Mending", mend_work(project, request), on_done, on_error)

The job's status has the share done and, as its message, the stage with the time left. Cancelling ends the process
within a moment; all clips are then unchanged, as after a crash at any moment.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.background.jobs import JobCancelled, JobContext
from app.mending.request import MendJob, MendRequest, MendResult
from app.project.mends.in_place import put_in_place
from app.project.mends.record import MendRecord
from app.project.project import Project
from engine.children.kind import STALL_S, ChildFailed, ChildKind
from engine.children.process import run_child
from engine.errors import ProjectError
from engine.progress import Progress, ReportProgress
from engine.storage.files import disk_error

MENDING: ChildKind[MendJob, Progress, MendResult] = ChildKind(
    place="app.mending.mend_project:MENDING",
    work="app.mending.child:main",
    what="The process that mends",
    job=MendJob,
    result=MendResult,
    stall_s=STALL_S,
    is_spreading=True,
)


@dataclass(frozen=True, slots=True)
class MendOutcome:
    """The result.

    Attributes:
        record: With figures before and after.
        number: Of the record in the project; None where nothing helped and nothing changed.
    """

    record: MendRecord
    number: int | None


def mend_project(
    project: Project,
    request: MendRequest,
    *,
    report: ReportProgress,
    alive: Callable[[], None] = lambda: None,
    n_threads: int | None = None,
    is_window_open: bool = False,
) -> MendOutcome:
    """Mend, and put the clips that changed in their place.

    Args:
        project: Open for writing.
        request: The boundary or frames to mend.
        report: Receives progress.
        alive: Called several times a second; an exception from it ends the work.
        n_threads: Threads to compute with; None for all cores.
        is_window_open: Leave the right of way to a window.
    Raises:
        EngineError: It cannot be mended; states why. All clips are unchanged.
    """
    project.check_writable()
    try:
        project.live_dir.mkdir(exist_ok=True)  # swept when the project is opened: drafts of a killed program go
    except OSError as error:
        raise disk_error(error, what="Temporary files of the mending", path=project.live_dir) from error
    folders = str(project.folder.absolute()), str(project.live_dir.absolute())
    job = MendJob(folders[0], request, folders[1], n_threads, is_window_open)
    drafts: dict[int, Path] = {}
    try:
        result = run_child(MENDING, job, report=report, alive=alive)
        drafts = {index: Path(path) for index, path in result.drafts.items()}
        alive()
        number = put_in_place(project, result.record, drafts) if result.record.has_helped else None
        return MendOutcome(result.record, number)
    except ChildFailed as error:
        text = f"{error}; no clip has changed."
        raise ProjectError(text, hint="Try again; see the log for details.") from error
    finally:
        for path in [*drafts.values(), *project.live_dir.glob("mended-*.safetensors")]:
            with suppress(OSError):
                path.unlink()


def mend_work(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
    """`mend_project` as the work of a Job, with a window open."""

    def work(context: JobContext) -> MendOutcome:
        def report(progress: Progress) -> None:
            context.report(progress.done, " - ".join(filter(None, [progress.stage, progress.message])))

        def alive() -> None:
            if context.is_cancelled:
                raise JobCancelled

        return mend_project(project, request, report=report, alive=alive, is_window_open=True)

    return work
