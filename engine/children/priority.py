"""Priorities: threads and processes that compute step back behind the window, so that drawing and input come first.

Nothing here changes how fast a machine with a free core computes; it decides who waits on one without.
"""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress

THREAD_NICENESS = 4
"""Of threads inside the window's process that draw or decode for it: behind the window, ahead of training."""
WORKER_NICENESS = 10
"""Of processes that compute in the background."""


IDLE_NICENESS = 19
"""Of processes whose work can wait for as long as anything else wants to compute."""


def lower_thread(niceness: int = THREAD_NICENESS) -> None:
    """Make the calling thread nicer than the rest of its process. Only Linux can; elsewhere nothing happens."""
    if sys.platform.startswith("linux"):
        with suppress(OSError):  # never needed for a right result
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)


def lower_process(niceness: int = WORKER_NICENESS) -> None:
    """Make the calling process nicer, with all threads it starts from now on."""
    if hasattr(os, "nice"):
        with suppress(OSError):
            os.nice(niceness)
    if hasattr(os, "SCHED_BATCH"):  # it never interrupts the window in the middle of a frame when it wakes up
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def idle_process() -> None:
    """Give the calling process, with all threads it starts from now on, only what nobody else computes with."""
    if hasattr(os, "nice"):
        with suppress(OSError):
            os.nice(IDLE_NICENESS)
    if hasattr(os, "SCHED_IDLE"):
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
