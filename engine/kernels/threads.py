"""Threads of the kernels: how many, which library runs them, and how long an idle one spins.

`configure_threads` is for the process that owns `main`: call it once, before the first kernel and best before torch is
imported, because OpenMP reads its environment when it is loaded (numba loads its own copy at the first parallel call,
torch's copy comes with torch). A parent that spawns a worker reaches both by setting GOMP_SPINCOUNT before the spawn.
Importing kernels changes nothing in the process.
"""

from __future__ import annotations

import logging
import os
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from threading import RLock
from typing import Any

import numba
import torch
from numba.core import config as _numba_config
from numba.np.ufunc.parallel import threading_layer

from engine.conventions import SPIN_COUNT

_config: Any = _numba_config  # its attributes are made at run time
_log = logging.getLogger(__name__)

_one_at_a_time = RLock()


def configure_threads(n_threads: int | None = None) -> int:
    """Set up the threads of this process; returns how many kernels called from this thread will use.

    Sets GOMP_SPINCOUNT unless it is set, chooses numba's OpenMP layer (the only common one that may be called from
    several threads at once) and limits numba and torch for the calling thread. Other Python threads start with all
    cores and may call this again for themselves.

    Args:
        n_threads: Threads for kernels; None means every core this process may use. Kept within 1..cores.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPIN_COUNT))
    try:
        threading_layer()
    except ValueError:  # not started yet: still ours to choose
        if _has_openmp():
            _config.THREADING_LAYER = "omp"
        else:
            _log.warning("numba finds no OpenMP runtime (libgomp); kernels run one call at a time")
    most = int(_config.NUMBA_NUM_THREADS)
    n_threads = most if n_threads is None else min(max(1, n_threads), most)
    numba.set_num_threads(n_threads)
    torch.set_num_threads(n_threads)
    return n_threads


def parallel_guard() -> AbstractContextManager[object]:
    """To be held around parallel kernels. Free where numba's threads may be shared, a lock where they may not."""
    numba.get_num_threads()  # starts the threads, so that the layer is known
    return _one_at_a_time if threading_layer() == "workqueue" else nullcontext()


def _has_openmp() -> bool:
    try:
        import_module("numba.np.ufunc.omppool")
    except ImportError:
        return False
    return True
