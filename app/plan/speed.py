"""How fast this machine trains: a few steps of known size, timed in a process of its own, for forecasts."""

from __future__ import annotations

import logging
from functools import cache

from app.lab.bench.timing import in_fresh_process
from engine.kernels.cache import is_cache_warm
from engine.training.plan.forecasting import UNKNOWN_MACHINE, MachineSpeed

logger = logging.getLogger(__name__)

REFERENCE_MS = 5.6
"""The fastest of the same steps on the machine of `engine.training.plan.cost`."""
N_STEPS, N_WARM = 40, 3
TIMEOUT_S = 30.0
_LOWEST, _HIGHEST = 0.1, 20.0


def machine_speed() -> MachineSpeed:
    """This machine against the one of the cost model. Takes two seconds, most of them imports; never fails.

    Where kernels are not compiled yet nothing is measured, since that alone takes longer.
    """
    if not is_cache_warm():
        return MachineSpeed(1.0, "cost model of another machine, kernels are not compiled here yet")
    measured_ms = in_fresh_process(_measure_ms, timeout_s=TIMEOUT_S)
    if measured_ms is None:
        logger.warning("the speed of this machine could not be measured")
        return UNKNOWN_MACHINE
    factor = min(max(measured_ms / REFERENCE_MS, _LOWEST), _HIGHEST)
    return MachineSpeed(factor, f"cost model times {factor:.2f}: a step of known size took {measured_ms:.1f} ms here")


def known_machine_speed() -> MachineSpeed:
    """The same, measured once in the life of the program, as soon as kernels are compiled."""
    return _measured_once(is_cache_warm())


@cache
def _measured_once(is_warm: bool) -> MachineSpeed:
    return machine_speed()


def _measure_ms() -> float:
    """Milliseconds of a step of 2,000 anchors at 240x180, on every core.

    The fastest of many, because a median of half a second says more about what else runs right now than about minutes
    of training.
    """
    from app.background.kernels import use_threads

    use_threads(None)
    from app.lab.bench.iteration import SIZES
    from app.lab.bench.step import StepRun

    run = StepRun(SIZES["2k"])
    return min([run.whole()[0] for _ in range(N_WARM + N_STEPS)][N_WARM:])
