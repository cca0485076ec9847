"""How things are timed here: candidates in turn after a warm-up, medians beside minima, memory in a fresh process."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.background.children import in_fresh_process
from app.background.memory import peak_bytes

MEMORY_TIMEOUT_S = 120.0


@dataclass(frozen=True, slots=True)
class Timing:
    """Milliseconds of one stage over several runs."""

    median_ms: float
    min_ms: float

    @classmethod
    def of(cls, runs_ms: Sequence[float]) -> Timing:
        """Median and minimum of at least one run."""
        return cls(statistics.median(runs_ms), min(runs_ms))


def interleaved(
    candidates: Mapping[str, Callable[[], Sequence[float]]], n_runs: int, *, n_warm: int = 2
) -> dict[str, list[Timing]]:
    """Time several candidates in turn, so that what else happens on the machine hits all of them alike.

    Args:
        candidates: Each runs once and returns milliseconds of its stages.
        n_runs: Runs of each that count.
        n_warm: Runs of each before, which do not.
    Returns:
        One Timing per stage and candidate.
    """
    runs: dict[str, list[Sequence[float]]] = {name: [] for name in candidates}
    for turn in range(n_warm + n_runs):
        for name, run in candidates.items():
            stages_ms = run()
            if turn >= n_warm:
                runs[name].append(stages_ms)
    return {name: [Timing.of(stage_ms) for stage_ms in zip(*rows, strict=True)] for name, rows in runs.items()}


def peak_extra_mb(prepare: Callable[..., Callable[[], object]], *arguments: Any) -> float | None:
    """How far a call pushes the memory of a fresh process beyond what it held before, MB. None if that fails.

    Args:
        prepare: Importable function that makes everything ready, warms kernels up and returns the call to measure.
        arguments: Its arguments.
    """
    return in_fresh_process(_extra_mb, prepare, *arguments, timeout_s=MEMORY_TIMEOUT_S)


def _extra_mb(prepare: Callable[..., Callable[[], object]], *arguments: Any) -> float:
    call = prepare(*arguments)
    before = peak_bytes(is_reset=True)
    kept = call()  # alive until the peak is read
    extra = peak_bytes() - before
    del kept
    return max(extra, 0) / 2**20
