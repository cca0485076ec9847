"""Python's cyclic garbage collector, kept from scanning modules, which are imported once and stay for good.

A collection scans every object and holds the interpreter meanwhile. With torch and numba loaded there are hundreds of
thousands, and every collection stalls the window for a tenth of a second.
"""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()
_n_loading = 0
_was_enabled = True
_n_modules = 0


@contextmanager
def uncollected() -> Iterator[None]:
    """Load modules in this block. Nothing is collected until the last such block in any thread ends; objects alive then
    are never scanned again, unless nothing was loaded. Garbage among them stays, little compared with modules."""
    global _n_loading, _n_modules, _was_enabled
    with _lock:
        if _n_loading == 0:
            _was_enabled, _n_modules = gc.isenabled(), len(sys.modules)
            gc.disable()
        _n_loading += 1
    try:
        yield
    finally:
        with _lock:
            _n_loading -= 1
            if _n_loading == 0:
                if len(sys.modules) > _n_modules:
                    gc.freeze()
                if _was_enabled:
                    gc.enable()
