"""How long a training step takes on this machine: a few, timed in a process of its own, for forecasts."""

from __future__ import annotations

import logging
from functools import cache

from app.background.children import in_fresh_process
from engine.kernels.cache import is_cache_warm
from engine.training.plan.plan import StepSizes

logger = logging.getLogger(__name__)

TIMEOUT_S = 60.0


def step_time(sizes: StepSizes, phase: str) -> float | None:
    """Seconds of a step of these sizes; takes some seconds, most of them imports, once in the life of the program.

    None where kernels are not compiled yet, since that alone takes longer, and where the steps failed.
    """
    if not is_cache_warm():
        return None
    found_s = _timed_once(sizes, phase)
    _known[sizes, phase] = found_s
    return found_s


_known: dict[tuple[StepSizes, str], float | None] = {}


def known_step_time(sizes: StepSizes, phase: str) -> float | None:
    """What `step_time` found earlier, without timing anything now: for when something else computes."""
    return _known.get((sizes, phase))


@cache
def _timed_once(sizes: StepSizes, phase: str) -> float | None:
    found_s = in_fresh_process(_time_steps, sizes, phase, timeout_s=TIMEOUT_S)
    if found_s is None:
        logger.warning("steps could not be timed on this machine")
    return found_s


def _time_steps(sizes: StepSizes, phase: str) -> float:
    from app.background.kernels import use_threads

    use_threads(None)
    from engine.training.plan.measured_steps import measured_step_s

    return measured_step_s(sizes, phase)
