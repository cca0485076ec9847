"""Watchdog: which turns of a window's loop took long, on what, and whether the thread computed, waited for a core, or
waited for a lock or a disk. For measurements; Linux says the most."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SLOW_S = 0.05
"""Phases that take longer are reported."""
SAMPLE_S = 0.01
STACK_DEPTH = 8


class Watchdog:
    """Watches phases of the thread that made it.

    Args:
        report: Called with a plain dict for each slow phase, on the watched thread.
        slow_s: What counts as slow, seconds.
    """

    def __init__(self, report: Callable[[dict[str, Any]], None], *, slow_s: float = SLOW_S) -> None:
        self._report, self._slow_s = report, slow_s
        self._ident = threading.get_ident()
        self._native_id = threading.get_native_id()
        self._began_s: float | None = None
        self._stacks: Counter[str] = Counter()
        self._sampler = threading.Thread(target=self._sample, name="watchdog", daemon=True)
        self._sampler.start()

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a part of a turn. Phases do not lie in each other."""
        self._stacks = Counter()
        cpu_s, queued_s = time.thread_time(), self._queued_s()
        process_s, began_s = time.process_time(), time.monotonic()
        self._began_s = began_s
        try:
            yield
        finally:
            self._began_s = None
            wall_s = time.monotonic() - began_s
            if wall_s > self._slow_s:
                self._report(
                    {
                        "slow": name,
                        "at_s": began_s,
                        "wall_ms": round(wall_s * 1e3, 1),
                        "computed_ms": round((time.thread_time() - cpu_s) * 1e3, 1),
                        "waited_for_a_core_ms": round((self._queued_s() - queued_s) * 1e3, 1),
                        "other_threads_computed_ms": round((time.process_time() - process_s) * 1e3, 1),
                        "others": self._other_threads(),
                        "stacks": [f"{n}x {stack}" for stack, n in self._stacks.most_common(3)],
                    }
                )

    def _queued_s(self) -> float:
        """How long the watched thread was ready to run and had no core, so far."""
        try:
            return int(Path(f"/proc/self/task/{self._native_id}/schedstat").read_text().split()[1]) / 1e9
        except (OSError, ValueError, IndexError):
            return 0.0

    def _other_threads(self) -> list[str]:
        frames = sys._current_frames()
        names = {thread.ident: thread.name for thread in threading.enumerate()}
        ours = (self._ident, threading.get_ident(), self._sampler.ident)
        return [f"{names.get(ident)}: {_place(frame)}" for ident, frame in frames.items() if ident not in ours]

    def _sample(self) -> None:
        while True:
            time.sleep(SAMPLE_S)
            began_s = self._began_s
            if began_s is not None and time.monotonic() - began_s > SAMPLE_S:
                frame = sys._current_frames().get(self._ident)
                if frame is not None:
                    self._stacks[_stack(frame)] += 1


def _place(frame: Any) -> str:
    (newest,) = traceback.extract_stack(frame, limit=1)
    return f"{Path(newest.filename).name}:{newest.lineno} {newest.name}"


def _stack(frame: Any) -> str:
    entries = traceback.extract_stack(frame)[-STACK_DEPTH:]
    return " < ".join(f"{Path(entry.filename).name}:{entry.lineno} {entry.name}" for entry in reversed(entries))
