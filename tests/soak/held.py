"""What a process holds of its machine: memory, handles, threads, children. Linux only: read from /proc."""

from __future__ import annotations

import ctypes
import gc
import os
import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Held:
    """What is held at a moment.

    Attributes:
        memory_mb: Private memory and this process's share of what several use, MB.
        handles: Open files, pipes and sockets.
        threads: Of the process.
        children: Processes that it has started and that have not ended, or were not waited for.
        blocks: Of memory that Python objects take.
    """

    memory_mb: float
    handles: int
    threads: int
    children: int
    blocks: int


def held_now() -> Held:
    """What this process holds once everything that is not used any more was given back."""
    gc.collect()
    with suppress(OSError, AttributeError):  # another C library
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    pss_kb = next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return Held(
        pss_kb / 1024,
        len(os.listdir("/proc/self/fd")),
        len(os.listdir("/proc/self/task")),
        _n_children(),
        sys.getallocatedblocks(),
    )


def _n_children() -> int:
    n = 0
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            n += len((task / "children").read_text().split())
    return n


def handle_names() -> Counter[str]:
    """What the open handles are of, to find out what is not closed."""
    names: Counter[str] = Counter()
    for handle in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            names[os.readlink(handle).split(":[")[0]] += 1
    return names


@dataclass(frozen=True, slots=True)
class Growth:
    """How far one number has grown from the beginning to the end.

    Attributes:
        name: Of the number.
        first, last: Medians of the first and of the last part, after warming up.
    """

    name: str
    first: float
    last: float

    @property
    def share(self) -> float:
        """0.05 for 5 % more."""
        return self.last / self.first - 1.0 if self.first else float(self.last > 0)

    def text(self) -> str:
        """In one line."""
        return f"{self.name:<10} {self.first:10.1f} -> {self.last:10.1f}  {100 * self.share:+6.2f} %"


def growths(samples: Sequence[Held], *, warm_up: int, period: int = 1) -> list[Growth]:
    """How far each number has grown, of medians of up to a third of the samples at either end.

    Args:
        samples: In the order of time, at equal moments of each round.
        warm_up: So many of the first ones do not count: caches fill, code is loaded.
        period: After so many rounds the same is done again; whole periods are compared.
    """
    rows = [astuple(sample) for sample in samples[warm_up:]]
    n = max(len(rows) // 3 // period * period, 1)
    return [
        Growth(
            field.name,
            statistics.median(row[column] for row in rows[:n]),
            statistics.median(row[column] for row in rows[-n:]),
        )
        for column, field in enumerate(fields(Held))
    ]
