"""Examines a capture in a separate process, so that the window keeps its interpreter to itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from engine.capture.capture import ONE_PASS_CACHE_BYTES, Capture, open_capture
from engine.children.child import Parent
from engine.children.kind import ChildFailed, ChildKind
from engine.children.process import run_child
from engine.errors import CaptureError
from engine.progress import Progress, ReportProgress

if TYPE_CHECKING:  # loading the doctor takes a second: that is left to the process
    from engine.doctor.doctor import Diagnosis


class ExamineJob(msgspec.Struct, frozen=True):
    """How the capture is opened."""

    capture: Path
    scale: float
    follow_links: bool
    frames: tuple[int, int] | None = None
    is_growing: bool = False


EXAMINING: ChildKind[ExamineJob, Progress, Diagnosis] = ChildKind(
    place="app.session.examining_process:EXAMINING",
    work="app.session.examining_process:examine_here",
    what="The process that examines the capture",
    job=ExamineJob,
    result="engine.doctor.doctor:Diagnosis",
    priority="idle",
)


def examine_apart(capture: Capture, report: ReportProgress) -> Diagnosis:
    """Have a process examine a capture, and wait for it.

    Args:
        report: Called several times a second; an exception of it ends the process.
    Raises:
        EngineError: The process raised it, or died.
    """
    seen = Progress("Capture doctor", 0.0, "starting")

    def see(progress: Progress) -> None:
        nonlocal seen
        seen = progress

    job = ExamineJob(
        capture.path,
        capture.scale,
        capture.follow_links,
        frames=capture.frames if capture.is_growing else None,  # others lack some of them
        is_growing=capture.is_growing,
    )
    try:
        return run_child(EXAMINING, job, report=see, alive=lambda: report(seen))
    except ChildFailed as error:
        raise CaptureError(f"{error}.", hint="Try again; see the log for details.", path=capture.path) from error


def examine_here(job: ExamineJob, parent: Parent[Progress]) -> Diagnosis:
    """Runs in the child."""
    from app.background.kernels import use_threads
    from app.background.logs import start_logging
    from engine.kernels.cache import use_kernel_cache

    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(None, with_torch=False)
    parent.report(Progress("Capture doctor", 0.0, "loading"))
    from engine.doctor.doctor import examine

    parent.report(Progress("Capture doctor", 0.0, "opening the capture"))
    capture = open_capture(
        job.capture,
        scale=job.scale,
        frames=job.frames,
        cache_bytes=ONE_PASS_CACHE_BYTES,
        follow_links=job.follow_links,
        is_growing=job.is_growing,
    )
    return examine(capture, report=parent.report)
