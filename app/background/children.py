"""Child processes: a number from one of their own, and how Ctrl+C does not reach them.

A terminal sends Ctrl+C to all of them; the parent decides what it means.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any


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


def in_fresh_process(call: Callable[..., float], *arguments: Any, timeout_s: float) -> float | None:
    """What a call returns in a process of its own; None if it fails or takes too long.

    Args:
        call: Importable function that returns a number.
        arguments: Its arguments.
        timeout_s: The process is ended after that.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_send_result, args=(theirs, call, arguments), daemon=True)
    with undisturbed():
        process.start()
    theirs.close()
    try:
        with suppress(EOFError, OSError):
            if ours.poll(timeout_s):
                return float(ours.recv_bytes())
        return None
    finally:
        process.kill()
        process.join()
        ours.close()


def _send_result(pipe: Connection, call: Callable[..., float], arguments: tuple[Any, ...]) -> None:
    number = call(*arguments)
    with suppress(OSError):  # whoever asked has gone
        pipe.send_bytes(str(number).encode())
