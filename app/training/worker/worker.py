"""The worker process: entry point, thread counts and log file. The loop itself is `run.TrainingRun`.

One process trains one clip and ends. Nothing imported here may draw anything.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from contextlib import suppress
from pathlib import Path

from app.background.kernels import use_threads
from app.background.logs import FORMAT, PrintableFormatter
from app.training.messages import Event, TrainJob, WarningRaised
from app.training.process import TrainTask
from app.training.worker.folder_store import FolderStore
from app.training.worker.run import TrainingRun
from engine.backends.table import choose_backend
from engine.children.child import Parent
from engine.children.kind import Unwanted, find
from engine.children.priority import lower_process
from engine.errors import DiskError
from engine.kernels.cache import use_kernel_cache
from engine.parallel import n_cores, share_cores
from engine.portable import cpu_kind
from engine.storage.files import disk_error, open_to_append

logger = logging.getLogger(__name__)


def n_training_threads(cores: int, *, is_window_open: bool, n_beside: int = 1) -> int:
    """Threads to compute with: one core is left to the window where there are more than two.

    Args:
        n_beside: How many trainings share the cores.
    """
    return max((cores - 1 if is_window_open and cores > 2 else cores) // n_beside, 1)


def main(task: TrainTask, parent: Parent[Event]) -> None:
    """Runs in the child until the clip is finished, stopped or failed."""
    job, refused = task.job, _redirect_output(task.log)
    use_kernel_cache()  # before the training imports kernels
    n_threads = _set_threads(job)
    choose_backend(job.backend)
    logger.info(
        "worker %d trains clip %d with %d threads; %s", os.getpid(), job.clip_index, n_threads, cpu_kind(job.cpu)
    )

    def send(event: Event) -> None:
        with suppress(Unwanted):  # the window is gone; `receive` notices that too and ends the run
            parent.report(event)

    if refused is not None:
        send(WarningRaised("The log of the training could not be written", str(refused)))
    run = TrainingRun(
        job,
        lambda: FolderStore(task.project, task.capture, job.claim),
        receive=parent.receive,
        send=send,
        make_training=find(task.make),
        n_threads=n_threads,
        starting_s=time.process_time(),  # imports, which are little else than computing
    )
    while run.advance():
        pass
    logger.info("worker %d ends", os.getpid())
    _flush_output()


def _redirect_output(path: Path) -> DiskError | None:
    """Everything printed, by us, by libraries or by a crash, goes to the log file, or nowhere if that cannot be opened.
    Returns the error then."""
    refused = None
    try:
        path.parent.mkdir(exist_ok=True)  # not the project itself, which may be gone
        descriptor = open_to_append(path)
    except OSError as error:
        refused = disk_error(error, what="The log", path=path)
        descriptor = os.open(os.devnull, os.O_WRONLY)
    sys.stdout.flush()
    sys.stderr.flush()
    _point_output_to(descriptor)
    logging.raiseExceptions = False  # a log on a full disk is not worth a word, and must not end anything
    logging.basicConfig(level=logging.INFO, stream=sys.stderr, force=True)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(PrintableFormatter(FORMAT))
    return refused


def _point_output_to(descriptor: int) -> None:
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)


def _flush_output() -> None:
    """Write the rest of the output. A full disk is ignored: Python would end with an error because of it."""
    logging.shutdown()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        _point_output_to(os.open(os.devnull, os.O_WRONLY))


def _set_threads(job: TrainJob) -> int:
    if job.is_window_open:  # before any thread is started, since threads take over the priority
        lower_process()
    share = n_training_threads(n_cores(), is_window_open=job.is_window_open, n_beside=job.n_beside)
    n_threads = job.n_threads or share
    share_cores(n_threads)  # preparation, too, and its own children
    return use_threads(n_threads)
