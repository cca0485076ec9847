"""Examines a capture in a process of its own, so that the window keeps its interpreter to itself."""

from __future__ import annotations

import logging
import multiprocessing
import signal
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from app.background.children import undisturbed
from engine.capture.capture import Capture, open_capture
from engine.errors import CaptureError, EngineError
from engine.progress import Progress, ReportProgress

if TYPE_CHECKING:  # loading what examines takes a second: that is left to the process
    from engine.doctor.doctor import Diagnosis

logger = logging.getLogger(__name__)
CACHE_BYTES = 32 << 20
"""Each picture is looked at once."""
POLL_S = 0.1
ENDED = "The process that examines the capture ended unexpectedly."


def examine_apart(capture: Capture, report: ReportProgress) -> Diagnosis:
    """Have a spawned process examine a capture, and wait for it.

    Args:
        report: Called several times a second; what it raises ends the process.
    Raises:
        CaptureError: What the process raised, or that it died.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    job = (str(capture.path), capture.scale, capture.follow_links, theirs)
    process = context.Process(target=main, args=job, name="capture doctor", daemon=True)
    try:
        with undisturbed():
            process.start()
        theirs.close()
        seen = Progress("Capture doctor", 0.0, "starting")
        while True:
            report(seen)
            if not ours.poll(POLL_S):
                continue
            try:
                said = ours.recv()
            except (EOFError, OSError):
                raise CaptureError(ENDED, hint="Try again; the log may say more.", path=capture.path) from None
            if isinstance(said, Progress):
                seen = said
            elif isinstance(said, tuple):
                message, hint, path = said
                raise CaptureError(message, hint=hint, path=path)
            else:
                return said
    finally:
        if process.pid is not None:
            process.kill()
            process.join()
        ours.close()


def main(path: str, scale: float, follow_links: bool, events: Connection) -> None:
    """Runs in the child."""
    from app.background.kernels import use_threads
    from app.background.logs import start_logging
    from app.background.priority import idle_process
    from engine.kernels.cache import use_kernel_cache

    idle_process()  # before any thread is started, since threads take over the priority
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C reaches the whole group; the parent decides what it means
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(None)
    with suppress(OSError):  # nobody listens any more
        try:
            from engine.doctor.doctor import examine

            capture = open_capture(Path(path), scale=scale, cache_bytes=CACHE_BYTES, follow_links=follow_links)
            events.send(examine(capture, report=events.send))
        except EngineError as error:
            events.send((error.message, error.hint, None if error.path is None else str(error.path)))
        except OSError:
            raise
        except Exception as error:  # the edge of the process
            logger.exception("examining has failed")
            events.send((f"Examining has failed ({type(error).__name__}: {error}).", "The log has more.", None))
