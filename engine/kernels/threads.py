"""Threads of the kernels: how many, which library runs them, and how long an idle one spins.

`configure_threads` is for the process that owns `main`: call it once, before the first kernel and best before torch is
imported, because OpenMP reads its environment when it is loaded (numba loads its own copy at the first parallel call,
torch's copy comes with torch). A parent that spawns a worker reaches both by setting GOMP_SPINCOUNT before the spawn.
Importing this module changes nothing in the process, and imports neither numba nor torch.
"""

from __future__ import annotations

import logging
import os
from importlib import import_module

SPIN_COUNT = 2_000
"""Rounds an idle OpenMP thread spins before it sleeps (GOMP_SPINCOUNT). libgomp's own 300,000 make a step several times
slower next to two busy processes, and sleeping at once makes it slower where nothing else runs."""

_log = logging.getLogger(__name__)


def configure_threads(n_threads: int | None = None, *, with_torch: bool = True) -> int:
    """Set up the threads of this process; returns how many kernels called from this thread will use.

    Sets GOMP_SPINCOUNT unless it is set, chooses numba's OpenMP layer (the only common one that may be called from
    several threads at once) and limits numba and torch for the calling thread. Other Python threads start with all
    cores and may call this again for themselves.

    Args:
        n_threads: Threads for kernels; None means every core this process may use. Kept within 1..cores.
        with_torch: Whether this process computes with torch too, which takes 190 MB once it is loaded.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPIN_COUNT))
    import numba

    from engine.kernels.numba_internals import choose_layer, layer, most_threads

    if layer() is None:  # not started yet: still ours to choose
        if _has_openmp():
            choose_layer("omp")
        else:
            _log.warning("numba finds no OpenMP runtime (libgomp); kernels run one call at a time")
    n_threads = most_threads() if n_threads is None else min(max(1, n_threads), most_threads())
    numba.set_num_threads(n_threads)
    if with_torch:
        import torch

        torch.set_num_threads(n_threads)
    return n_threads


def _has_openmp() -> bool:
    try:
        import_module("numba.np.ufunc.omppool")
    except ImportError:
        return False
    return True
