"""The process that mends. Nothing here draws anything."""

from __future__ import annotations

from app.background.kernels import use_threads
from app.background.logs import start_logging
from app.mending.carry_out import mend
from app.mending.request import MendJob, MendResult
from engine.backends.table import choose_backend
from engine.children.child import Parent
from engine.children.priority import lower_process
from engine.kernels.cache import use_kernel_cache
from engine.progress import Progress


def main(job: MendJob, parent: Parent[Progress]) -> MendResult:
    """Carry out the job; leaves drafts of clips."""
    if job.is_window_open:
        lower_process()  # before any thread computes, since threads take over the priority
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(job.n_threads)
    choose_backend(job.backend)
    return mend(job, parent.report)
