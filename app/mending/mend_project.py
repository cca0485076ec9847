"""Mending a project: in a process of its own, and then its clips in their place. For a window and the command line.

    jobs.start("Mending", mend_work(project, request), on_done, on_error)

The job's status has the share that is done and, as its message, the stage with the time that is left. Cancelling ends
the process within a moment; all clips are as they were then, as after a crash at any moment.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from app.background.jobs import JobCancelled, JobContext
from app.calibration.job import TimeLeft
from app.mending.request import MendJob, MendRequest, MendResult
from app.project.mends.in_place import put_in_place
from app.project.mends.record import MendRecord
from app.project.project import Project
from engine.children.running import child_folder, run_child
from engine.errors import ProjectError
from engine.progress import Progress, ReportProgress
from engine.storage.files import disk_error

FOLDER_PREFIX = "clipgstream-mending-"
WHAT = "Temporary files of the mending"


@dataclass(frozen=True, slots=True)
class MendOutcome:
    """What came of it.

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
        request: What is to be mended.
        report: Told how far it is.
        alive: Called several times a second; what it raises ends the work.
        n_threads: What to compute with; None for all cores.
        is_window_open: Leave the right of way to a window.
    Raises:
        ProjectError: It cannot be mended; says why. All clips are as they were.
    """
    project.check_writable()
    with child_folder(FOLDER_PREFIX, what=WHAT) as scratch:
        job, result = scratch / "job.json", scratch / "result.json"
        told = _Told(scratch / "progress.json", report)

        def look() -> None:
            alive()
            told.look()

        try:
            project.live_dir.mkdir(exist_ok=True)  # swept when the project is opened: drafts of a killed program go
            content = MendJob(
                str(project.folder.absolute()), request, str(project.live_dir.absolute()), n_threads, is_window_open
            )
            job.write_bytes(msgspec.json.encode(content))
        except OSError as error:
            raise disk_error(error, what=WHAT, path=job) from error
        drafts: list[Path] = []
        try:
            reason, _ = run_child("app.mending.child", job, result, what="The process that mends", alive=look)
            if reason:
                raise ProjectError(f"{reason}; all clips are as they were.", hint="Try again; the log may say more.")
            outcome = msgspec.json.decode(result.read_bytes(), type=MendResult)
            drafts = [Path(path) for path in outcome.drafts.values()]
            if outcome.record is None:
                raise ProjectError(outcome.message, hint=outcome.hint)
            number = None
            alive()
            if outcome.record.has_helped:
                paths = {index: Path(path) for index, path in outcome.drafts.items()}
                number = put_in_place(project, outcome.record, paths)
            return MendOutcome(outcome.record, number)
        finally:
            for path in [*drafts, *project.live_dir.glob("mended-*.safetensors")]:
                with suppress(OSError):
                    path.unlink()


def mend_work(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
    """`mend_project` as the work of a Job, beside a window."""

    def work(context: JobContext) -> MendOutcome:
        left = TimeLeft()

        def report(progress: Progress) -> None:
            said = " - ".join(filter(None, [progress.stage, progress.message, left.text(progress.done)]))
            context.report(progress.done, said)

        def alive() -> None:
            if context.is_cancelled:
                raise JobCancelled

        return mend_project(project, request, report=report, alive=alive, is_window_open=True)

    return work


class _Told:
    """What the child has said last."""

    def __init__(self, path: Path, report: ReportProgress) -> None:
        self._path, self._report, self._last = path, report, b""

    def look(self) -> None:
        with suppress(OSError, ValueError):
            said = self._path.read_bytes()
            if said != self._last:
                self._last = said
                document = json.loads(said)
                self._report(Progress(document["stage"], document["done"], document["message"]))
