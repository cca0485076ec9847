"""InTurn: a thread for short pieces of work with a disk that may be slow, one after the other in the order given."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")


class InTurn:
    """Methods are for one thread. The thread that works starts with the first piece. Unlike one of ThreadPoolExecutor,
    it is not waited for when the program ends: a disk may never answer.

    Args:
        name: Of the thread.
        is_apart: Whether there is one; else work is done where it is given.
    """

    def __init__(self, name: str, *, is_apart: bool = True) -> None:
        self._name, self._is_apart = name, is_apart
        self._waiting: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] | None = None

    def do(self, work: Callable[[], T], *, wait_s: float) -> Future[T]:
        """Have something done after all that went before.

        Args:
            wait_s: Wait so long for it.
        Returns:
            Its result, or its error, once it is done.
        """
        future: Future[T] = Future()
        if not self._is_apart:
            _work(future, work)
            return future
        if self._waiting is None:
            self._waiting = SimpleQueue()
            threading.Thread(target=_run, args=(self._waiting,), name=self._name, daemon=True).start()
        self._waiting.put((future, work))
        wait([future], wait_s)
        return future

    def close(self) -> None:
        """Let the thread end after all that was given to it. Anything later starts another."""
        if self._waiting is not None:
            self._waiting.put(None)
            self._waiting = None


def _run(waiting: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None]) -> None:
    while (given := waiting.get()) is not None:
        _work(*given)


def _work(future: Future[T], work: Callable[[], T]) -> None:
    try:
        future.set_result(work())
    except Exception as error:  # noqa: BLE001 - handed to whoever asks for the result
        future.set_exception(error)
