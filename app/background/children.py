"""Processes of multiprocessing: started one way, ended with this one.

A terminal sends Ctrl+C to all of them; the parent decides what it means. While the program ends nobody starts another
one, and it waits for those that are just being started: a child whose parent ends meanwhile finds half of what it is
told, and says so on the terminal.
"""

from __future__ import annotations

import atexit
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess

from engine.children.process import undisturbed

STARTED_WITHIN_S = 10.0
"""So long the program waits at its end for a process that is being started."""


class NoLongerWanted(OSError):
    """No process is started or waited for any more: the program, or whoever has asked, ends."""


class _Starts:
    """Counts those that are being started. For any thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._n_starting = 0
        self._is_over = False

    @property
    def is_over(self) -> bool:
        """Whether the program ends."""
        return self._is_over

    @contextmanager
    def one(self) -> Iterator[None]:
        """Start one in this block."""
        with self._changed:
            if self._is_over:
                raise NoLongerWanted
            self._n_starting += 1
        try:
            yield
        finally:
            with self._changed:
                self._n_starting -= 1
                self._changed.notify_all()

    def end(self) -> None:
        """Let nobody start another one, and wait for those that are being started."""
        with self._changed:
            self._is_over = True
            self._changed.wait_for(lambda: self._n_starting == 0, STARTED_WITHIN_S)


_starts = _Starts()
atexit.register(_starts.end)  # before multiprocessing, which was imported earlier, ends the processes that it knows


def start_child(process: BaseProcess) -> None:
    """Start a process of multiprocessing.

    Raises:
        Unwanted: The program ends.
        OSError: The system refused.
    """
    with _starts.one(), undisturbed():
        process.start()
