"""How many cores a process may use, and ordered maps over cameras or blocks on as many threads. Only for kernels that
release the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import pairwise
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


CORES_VARIABLE = "CLIPGSTREAM_CORES"
"""Environment variable with the most cores that a process and its children use, so that several share a machine."""


def n_cores() -> int:
    """Cores this process may use: those that the system gives it, or fewer where CORES_VARIABLE says so."""
    n_there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with suppress(KeyError, ValueError):
        return min(n_there, max(int(os.environ[CORES_VARIABLE]), 1))
    return n_there


def share_cores(n: int) -> None:
    """Let this process use no more than n cores, and children that it starts from now on. Call it before kernels are
    imported: numba reads how many threads it may have when it is loaded."""
    os.environ[CORES_VARIABLE] = str(n)
    os.environ.setdefault("NUMBA_NUM_THREADS", str(n))


def map_ordered(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`[function(i) for i in items]` on all cores. Results keep the order, so outcomes never depend on timing."""
    items = list(items)
    if len(items) < 2 or n_cores() == 1:
        return [function(item) for item in items]
    with ThreadPoolExecutor(max_workers=min(len(items), n_cores())) as pool:
        return list(pool.map(function, items))


def row_spans(n_rows: int, n_spans: int | None = None) -> list[tuple[int, int]]:
    """Cut range(n_rows) into contiguous spans, about four per core so that uneven rows balance."""
    n_spans = min(max(n_rows, 1), n_spans or 4 * n_cores())
    edges = [n_rows * i // n_spans for i in range(n_spans + 1)]
    return list(pairwise(edges))
