"""How things are timed here: candidates in turn after a warm-up, medians next to minima, memory in a fresh process."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import msgspec

from app.background.memory import peak_bytes
from engine.children.child import Parent
from engine.children.kind import ChildFailed, ChildKind, find
from engine.children.messages import decoded, encoded
from engine.children.process import run_child
from engine.progress import Progress

Argument = TypeVar("Argument")


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
    """Time several candidates in turn, so that other load on the machine hits all of them alike.

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


class PeakJob(msgspec.Struct, frozen=True):
    """Function and type of its argument as "module:name", and the argument encoded."""

    prepare: str
    kind: str
    argument: bytes


PEAK: ChildKind[PeakJob, Progress, float] = ChildKind(
    place="app.lab.bench.timing:PEAK",
    work="app.lab.bench.timing:extra_mb",
    what="The process that measures memory",
    job=PeakJob,
    result=float,
)


def peak_extra_mb(prepare: Callable[[Argument], Callable[[], object]], argument: Argument) -> float | None:
    """Memory that a call adds to a fresh process at its peak, MB. None if that fails.

    Args:
        prepare: Importable function that makes everything ready, warms kernels up and returns the call to measure.
        argument: For it.
    """
    name, kind = (f"{item.__module__}:{item.__qualname__}" for item in (prepare, type(argument)))
    try:
        return run_child(PEAK, PeakJob(name, kind, encoded(argument)))
    except ChildFailed:
        return None


def extra_mb(job: PeakJob, parent: Parent[Progress]) -> float:
    """Runs in the child."""
    call = find(job.prepare)(decoded(job.argument, job.kind))
    before = peak_bytes(is_reset=True)
    kept = call()  # alive until the peak is read
    extra = peak_bytes() - before
    del kept
    return max(extra, 0) / 2**20
