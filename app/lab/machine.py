"""The machine that a figure was measured on: processor, cores, versions, date."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from contextlib import suppress
from dataclasses import dataclass
from datetime import date


@dataclass(frozen=True, slots=True)
class Machine:
    """One line under every table. `vectors` names the widest instruction set, `load` the load average at the
    start, below zero where the system knows none."""

    cpu: str
    n_cores: int
    n_threads: int
    vectors: str
    system: str
    python: str
    torch: str
    numba: str
    day: str
    load: float

    def __str__(self) -> str:
        load = f", load {self.load:.1f}" if self.load >= 0 else ""
        return (
            f"{self.cpu}, {self.n_cores} cores ({self.n_threads} threads used), {self.vectors}; {self.system}; "
            f"Python {self.python}, torch {self.torch}, numba {self.numba}; {self.day}{load}"
        )


def describe_machine(n_threads: int) -> Machine:
    """Look at this machine."""
    from app.cli.doctor import host_vectors
    from engine.parallel import n_cores

    return Machine(
        cpu=_cpu(),
        n_cores=n_cores(),
        n_threads=n_threads,
        vectors=host_vectors()[0],
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        torch=importlib.metadata.version("torch"),
        numba=importlib.metadata.version("numba"),
        day=date.today().isoformat(),
        load=os.getloadavg()[0] if hasattr(os, "getloadavg") else -1.0,
    )


def _cpu() -> str:
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith("model name"):
                return " ".join(line.split(":", 1)[1].split())
    return platform.processor() or platform.machine()
