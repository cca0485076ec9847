"""How long a training step takes on this machine: a few, timed in a process of its own, for forecasts."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import msgspec

from engine.backends.table import choose_backend, chosen_name, process_backend
from engine.children.child import Parent
from engine.children.kind import ChildFailed, ChildKind, Unwanted
from engine.children.process import run_child
from engine.errors import EngineError
from engine.kernels.cache import is_cache_warm
from engine.progress import Progress
from engine.training.plan.plan import StepSizes

logger = logging.getLogger(__name__)

TIMEOUT_S = 60.0


class TimedSteps(msgspec.Struct, frozen=True):
    """The steps to time."""

    sizes: StepSizes
    phase: str
    backend: str


TIMING: ChildKind[TimedSteps, Progress, float] = ChildKind(
    place="app.plan.speed:TIMING",
    work="app.plan.speed:time_steps",
    what="The process that times steps",
    job=TimedSteps,
    result=float,
)

_known: dict[tuple[StepSizes, str], float | None] = {}


def step_time(sizes: StepSizes, phase: str, is_wanted: Callable[[], bool] = lambda: True) -> float | None:
    """Seconds of a step of these sizes; takes some seconds, most of them imports, once in the life of the program.

    None where kernels are not compiled yet, since that alone takes longer, and where the steps failed.

    Args:
        is_wanted: Asked several times a second; the process is ended once it is not.
    Raises:
        Unwanted: It is no longer wanted; nothing is known.
    """
    if not is_cache_warm():
        return None
    if (sizes, phase) not in _known:
        until_s = time.monotonic() + TIMEOUT_S

        def alive() -> None:
            if not is_wanted():
                raise Unwanted
            if time.monotonic() > until_s:
                raise TimeoutError(f"no step in {TIMEOUT_S:.0f} s")

        try:
            _known[sizes, phase] = run_child(TIMING, TimedSteps(sizes, phase, chosen_name()), alive=alive)
        except (ChildFailed, EngineError, TimeoutError) as error:
            logger.warning("steps could not be timed on this machine: %s", error)
            _known[sizes, phase] = None
    return _known[sizes, phase]


def known_step_time(sizes: StepSizes, phase: str) -> float | None:
    """The earlier result of `step_time`, without timing anything now: for when something else computes."""
    return _known.get((sizes, phase))


def time_steps(job: TimedSteps, parent: Parent[Progress]) -> float:
    """Runs in the child."""
    from app.background.kernels import use_threads

    use_threads(None)
    choose_backend(job.backend)
    from engine.training.plan.measured_steps import measured_step_s

    return measured_step_s(job.sizes, job.phase, process_backend())
