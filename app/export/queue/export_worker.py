"""The process that exports: runs one job, and reports how far it is for as long as it is wanted.

Nothing imported here may draw anything. It has the lowest priority, so that the window and trainings come first.
"""

from __future__ import annotations

import os
import time

from app.background.kernels import use_threads
from app.background.logs import start_logging
from app.export.export_progress import ExportProgress, ExportResult, Report
from app.export.queue.export_jobs import ExportTask, run_task
from engine.backends.table import choose_backend
from engine.children.child import Parent
from engine.children.priority import IDLE_NICENESS, lower_process
from engine.kernels.cache import use_kernel_cache

REPORT_EVERY_S = 0.25
"""Nobody reads faster, and each time the window is drawn, which takes cores where there is no graphics processor."""


def main(task: ExportTask, parent: Parent[ExportProgress]) -> ExportResult:
    """Runs in the child until the job has ended."""
    lower_process(IDLE_NICENESS)  # before any thread is started, since threads take over the priority
    if task.n_threads is not None:
        os.environ["NUMBA_NUM_THREADS"] = str(task.n_threads)  # of whatever asks for all cores, too
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(task.n_threads)
    choose_backend(task.backend)
    parent.report(ExportProgress(0, 0, message="Opening the project"))
    return run_task(task, reporting(parent))


def reporting(parent: Parent[ExportProgress]) -> Report:
    """A job's function to report with: it passes on what somebody reads, and raises Unwanted once nobody does."""
    reported_s = -REPORT_EVERY_S

    def report(progress: ExportProgress) -> None:
        nonlocal reported_s
        parent.receive(0.0)
        now_s = time.monotonic()
        if now_s - reported_s >= REPORT_EVERY_S or progress.n_done == progress.n_all:
            reported_s = now_s
            parent.report(progress)

    return report
