"""Python's collector of garbage in cycles, kept from looking through what is imported once and stays for good.

A run of it looks at every object and holds the interpreter meanwhile. With torch and numba loaded those are hundreds of
thousands, and every run takes a tenth of a second in which a window stands still.
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
    """Load modules in this block: nothing is collected until the last such block of all threads ends, and what is there
    then is never looked at again, unless nothing was loaded. Garbage among it stays, little compared with modules."""
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
