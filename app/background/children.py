"""Child processes that Ctrl+C does not reach: a terminal sends it to all of them, the parent decides what it means."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def undisturbed() -> Iterator[None]:
    """Start processes in this block. A child takes over which signals are held back, and this one never lets go of it.

    Without it, Ctrl+C in the seconds in which a child imports its modules ends it with a traceback on the terminal. A
    signal that comes during the block reaches this process after it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows, where children are asked by other means
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
