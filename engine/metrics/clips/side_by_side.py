"""Several iterators at the same time, on threads: their items as they come, and a clean end whenever one is wanted.

Only for work that releases the interpreter lock, as kernels, numpy and torch do.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")
_POLL_S = 0.2
"""Waiting without a limit could not be interrupted everywhere."""


def side_by_side(
    iterators: Iterable[Iterator[Item]], *, n_threads: int, prepare: Callable[[], object] = lambda: None
) -> Iterator[Item]:
    """Items of all iterators: those of one in their order, those of several mixed.

    Each iterator belongs to one thread, which takes the next when it is exhausted. An error of one of them ends all and
    is raised here. When the caller stops early, or is interrupted, each thread ends with the item it is at.

    Args:
        n_threads: At most so many are worked on at a time; as many items wait to be taken.
        prepare: Called once on each thread before its first iterator.
    """
    waiting = deque(iterators)
    ready: queue.Queue[tuple[Item | None, BaseException | None]] = queue.Queue(maxsize=n_threads)
    stop = threading.Event()

    def hand_over(item: Item | None, error: BaseException | None) -> None:
        while not stop.is_set():
            try:
                ready.put((item, error), timeout=_POLL_S)
            except queue.Full:
                continue
            return

    def work() -> None:
        try:
            prepare()
            while not stop.is_set():
                try:
                    iterator = waiting.popleft()
                except IndexError:
                    return
                for item in iterator:
                    hand_over(item, None)
                    if stop.is_set():
                        return
        except BaseException as error:  # noqa: BLE001 - raised again by the caller's thread
            hand_over(None, error)

    threads = [threading.Thread(target=work, daemon=True) for _ in range(max(1, min(n_threads, len(waiting))))]
    for thread in threads:
        thread.start()
    try:
        while True:
            is_over = not any(thread.is_alive() for thread in threads)  # asked first: then nothing more is added
            try:
                item, error = ready.get(timeout=0.0 if is_over else _POLL_S)
            except queue.Empty:
                if is_over:
                    return
                continue
            if error is not None:
                raise error
            yield item  # type: ignore[misc]
    finally:
        stop.set()
        for thread in threads:
            thread.join()
