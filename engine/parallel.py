"""Ordered maps over cameras or blocks on a few threads. Only for kernels that release the GIL; owns no state."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def n_cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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
