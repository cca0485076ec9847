"""The compiled kernels, as the program uses them: compiling them where no window waits, and threads to run them on.

Compiling holds the interpreter lock for seconds, so it happens in separate processes
(`engine.kernels.compile_ahead`).
"""

from __future__ import annotations

import logging

from app.background.collector import uncollected
from app.background.libraries import load_libraries
from engine.backends.table import process_backend
from engine.kernels.cache import is_cache_warm
from engine.kernels.compile_ahead import compile_all
from engine.kernels.threads import configure_threads
from engine.progress import Progress, ReportProgress

logger = logging.getLogger(__name__)

COMPILING = "Compiling kernels, first start only"


def warm_cache() -> None:
    """Compile kernels missing from the cache. Blocks until it is done; a failure is logged and otherwise ignored."""
    try:
        compile_all(backend=process_backend().name)
    except OSError as error:
        logger.warning("kernels could not be compiled ahead: %s", error)


def warm_up_reporting(report: ReportProgress) -> None:
    """Compile kernels missing from the cache, reporting progress, and load everything that a training step of this
    process's back end needs.

    An exception of `report` ends the compiling processes and passes on.
    """
    said = -1

    def report_groups(done: int, n: int, what: str) -> None:
        nonlocal said
        message = f"{done} of {n} groups of kernels are compiled" if done > max(said, 0) else ""
        said = max(said, done)
        report(Progress(COMPILING, done / max(n, 1), message))

    backend = process_backend()
    compile_all(report_groups, backend=backend.name)
    backend.warm_up(is_training=True)


def use_threads(n_threads: int | None, *, with_torch: bool = True) -> int:
    """Set how many threads the calling thread computes with; None for every core. Returns how many it will be.

    Args:
        with_torch: See `configure_threads`.
    """
    return configure_threads(n_threads, with_torch=with_torch)


def prepare_drawing() -> None:
    """Once on a thread that draws: compiled kernels, one core, and everything loaded that a first picture needs."""
    load_libraries()
    warm_cache()
    with uncollected():
        use_threads(1)
        if is_cache_warm():
            process_backend().warm_up(is_training=False)


def prepare_decoding() -> None:
    """Once on a thread that decodes: one core, and everything loaded that a first frame needs."""
    load_libraries()
    with uncollected():
        from engine.model import clip_model  # noqa: F401

        use_threads(1)


def prepare_selecting() -> None:
    """Once on a thread that selects: its kernels, compiled before or now."""
    warm_cache()
    with uncollected():
        if is_cache_warm():
            from engine.editing.selection.warm import warm_up

            warm_up()
