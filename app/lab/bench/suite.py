"""Sets of measurements: the quick set of `clipgstream bench` and the full one, and the document they yield."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field

from app.lab.bench.raster import limit_shares, measure_raster
from app.lab.bench.rows import IterationRow, KernelRow, SpeedError, Trade
from app.lab.machine import Machine, describe_machine

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class Plan:
    """Names of scenes and sizes, see `raster.RECIPES`, `field.SCENES` and `iteration.SIZES`; settings to train with.

    Attributes:
        raster, decode: Scenes.
        iterations: Sizes, each as "joint" and as "source".
        with_memory: Scenes whose peak memory is measured as well, in a separate process.
        n_runs: Runs of the kernels that count.
        n_steps: Training steps that count.
        settings: As NAME=VALUE, by operation: "step" for what changes a training step, "clip" for what changes how many
            there are or the sizes. Used where a capture is given, see `settings.trainings`.
    """

    raster: tuple[str, ...] = ()
    decode: tuple[str, ...] = ()
    iterations: tuple[str, ...] = ()
    with_memory: frozenset[str] = frozenset()
    n_runs: int = 10
    n_steps: int = 30
    settings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


QUICK = Plan(
    raster=("small", "heavy", "medium"),
    decode=("2k", "8k"),
    iterations=("2k", "8k"),
    with_memory=frozenset({"medium"}),
    settings={"step": ("gaussians_per_anchor=2", "tiles=all"), "clip": ("quality=draft", "preset=toy")},
)
FULL = Plan(
    raster=("accuracy", "small", "heavy", "medium", "large"),
    decode=("2k", "8k", "8k heads", "8k source", "50k", "50k heads"),
    iterations=("2k", "8k", "8k k=10"),
    with_memory=frozenset({"small", "heavy", "medium", "large", "8k", "50k"}),
    n_runs=20,
    n_steps=60,
    settings={
        "step": ("gaussians_per_anchor=2", "gaussians_per_anchor=10", "tiles=all", "gate=static", "gate=off"),
        "clip": ("quality=draft", "quality=best", "preset=toy", "preset=medium"),
    },
)


@dataclass(slots=True)
class Report:
    """Everything measured. `fma_per_s` is the machine's limit of sixteen-lane multiply-adds, all threads together;
    `trades` are settings of trainings and exports, where a capture was given."""

    machine: Machine
    fma_per_s: float
    kernels: list[KernelRow] = field(default_factory=list)
    marks: list[SpeedError] = field(default_factory=list)
    iterations: list[IterationRow] = field(default_factory=list)
    trades: list[Trade] = field(default_factory=list)


Say = Callable[[str, float], None]
"""The present measurement, and the share of the plan that is done."""


def run_plan(plan: Plan, *, n_threads: int | None = None, say: Say = lambda what, done: None) -> Report:
    """Measure a plan; kernels are loaded or compiled first.

    Args:
        plan: The measurements.
        n_threads: Threads to compute with; every core when None.
        say: Called before each measurement.
    """
    from app.background.kernels import use_threads, warm_cache

    n_threads = use_threads(n_threads)
    from app.lab.bench.field import measure_decode
    from app.lab.bench.fma_limit import measure_fma_limit
    from app.lab.bench.iteration import measure_iteration

    n = len(plan.raster) + len(plan.decode) + 2 * len(plan.iterations) + 2
    n_done = 0

    def begin(what: str) -> None:
        nonlocal n_done
        say(what, n_done / n)
        n_done += 1

    begin("compiling kernels, first start only")
    warm_cache()
    begin("multiply-add limit")
    report = Report(describe_machine(n_threads), measure_fma_limit())
    for name in plan.raster:
        begin(f"raster, {name}")
        row, marks = measure_raster(name, n_runs=plan.n_runs, has_memory=name in plan.with_memory)
        report.kernels.append(row)
        report.marks += marks
    for name in plan.decode:
        begin(f"decode, {name}")
        row, marks = measure_decode(name, n_runs=plan.n_runs, has_memory=name in plan.with_memory)
        report.kernels.append(row)
        report.marks += marks
    for name in plan.iterations:
        for is_source in (False, True):
            begin(f"training step, {name}, {'source' if is_source else 'joint'}")
            step, marks = measure_iteration(name, is_source=is_source, n_runs=plan.n_steps)
            report.iterations.append(step)
            report.marks += marks
    report.fma_per_s = max(report.fma_per_s, measure_fma_limit())  # a disturbance of the first may be over
    say("done", 1.0)
    return report


def document(report: Report) -> dict:
    """The report as plain values for JSON."""
    kernels = []
    for row in report.kernels:
        forward, backward = limit_shares(row, report.fma_per_s) or (None, None)
        kernels.append(asdict(row) | {"forward_limit_share": forward, "backward_limit_share": backward})
    return {
        "schema": SCHEMA,
        "machine": asdict(report.machine),
        "fma_per_s": report.fma_per_s,
        "kernels": kernels,
        "speed_error": [asdict(mark) for mark in report.marks],
        "settings": [asdict(trade) for trade in report.trades],
        "iterations": [
            asdict(row) | {"stages": {name: asdict(timing) for name, timing in row.stages}} for row in report.iterations
        ],
    }
