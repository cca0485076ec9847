"""How things are timed here: candidates in turn after a warm-up, medians beside minima, memory in a fresh process."""

from __future__ import annotations

import multiprocessing
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

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
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_measure_memory, args=(theirs, prepare, arguments), daemon=True)
    process.start()
    theirs.close()
    try:
        with suppress(EOFError, OSError):
            if ours.poll(MEMORY_TIMEOUT_S):
                return float(ours.recv_bytes())
        return None
    finally:
        process.kill()
        process.join()
        ours.close()


def _measure_memory(pipe: Connection, prepare: Callable[..., Callable[[], object]], arguments: tuple[Any, ...]) -> None:
    call = prepare(*arguments)
    before = _peak_bytes(is_reset=True)
    kept = call()  # alive until the peak is read
    extra = _peak_bytes() - before
    del kept
    pipe.send_bytes(str(max(extra, 0) / 2**20).encode())


def _peak_bytes(*, is_reset: bool = False) -> int:
    """Most memory this process ever held, bytes; since now if it can be reset.

    On Linux the kernel's high-water mark of this very process: ru_maxrss begins at the size of the parent.
    """
    if sys.platform == "linux":
        if is_reset:
            with suppress(OSError), open("/proc/self/clear_refs", "w", encoding="ascii") as file:
                file.write("5")
        with suppress(OSError, ValueError, StopIteration), open("/proc/self/status", encoding="ascii") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))
    try:
        import resource
    except ImportError:  # Windows
        raise NotImplementedError("peak memory is not known on this system") from None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
