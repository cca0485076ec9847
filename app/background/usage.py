"""Use of the machine by processes: memory and processor time, read from the system at most once a second.

Linux reports both for every process; elsewhere only the processor time of this one is known.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from app.status import UsageStatus
from engine.parallel import n_cores

SAMPLE_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class ProcessUsage:
    """Of one process. memory_mb in 10^6 bytes; cpu_s: processor time since it began. None where not known."""

    memory_mb: float | None = None
    cpu_s: float | None = None


def read_usage(pid: int | None = None) -> ProcessUsage:
    """Of a process, this one when None. Values are None where unknown, or where the process has ended."""
    memory_mb = cpu_s = None
    if sys.platform.startswith("linux"):
        place = f"/proc/{'self' if pid is None else pid}"
        with suppress(OSError, ValueError, IndexError):
            with open(f"{place}/statm", encoding="ascii") as file:
                memory_mb = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
            with open(f"{place}/stat", encoding="utf-8", errors="replace") as file:
                fields = file.read().rpartition(")")[2].split()  # the name before may hold anything
            cpu_s = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    elif pid is None:
        cpu_s = time.process_time()
    return ProcessUsage(memory_mb, cpu_s)


class UsageMeter:
    """Usage of the window's process and of trainings. For one thread; takes a tenth of a millisecond.

    Args:
        clock: Seconds.
        read: Reads one process; tests bring their own.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, read: Callable[[int | None], ProcessUsage] = read_usage
    ) -> None:
        self._clock, self._read = clock, read
        self._sampled_s = -SAMPLE_EVERY_S
        self._before: dict[int | None, float] = {}
        self._status = UsageStatus(n_cores=n_cores())

    def sample(self, worker_pids: Sequence[int]) -> UsageStatus:
        """The usage now, or that of the last look while that is less than a second ago.

        Args:
            worker_pids: Processes of trainings.
        """
        now_s = self._clock()
        passed_s = now_s - self._sampled_s
        if passed_s < SAMPLE_EVERY_S:
            return self._status
        found = {pid: self._read(pid) for pid in (None, *worker_pids)}
        cores: dict[int | None, float | None] = {}
        for pid, usage in found.items():
            before = self._before.get(pid)
            cores[pid] = None if before is None or usage.cpu_s is None else max(usage.cpu_s - before, 0.0) / passed_s
        self._before = {pid: usage.cpu_s for pid, usage in found.items() if usage.cpu_s is not None}
        self._sampled_s = now_s
        self._status = UsageStatus(
            window_mb=found[None].memory_mb,
            window_cores=cores[None],
            training_mb=_together([found[pid].memory_mb for pid in worker_pids]),
            training_cores=_together([cores[pid] for pid in worker_pids]),
            n_cores=n_cores(),
        )
        return self._status


def _together(values: list[float | None]) -> float | None:
    """Their sum; None where none is known."""
    known = [value for value in values if value is not None]
    return sum(known) if known else None
