"""The liberties that kernels give the compiler with floating-point numbers; fewer where numbers must be portable.

With `arcp` and `afn` LLVM divides and takes roots by the processor's estimates (rcpps, rsqrtps and later ones). How
many bits of an estimate are right is a promise, but which bits follow is not: makers differ, and so would results.
"""

from __future__ import annotations

import os

CPU_VARIABLE = "CLIPGSTREAM_CPU"
"""Says to kernels of a process whether their numbers are to be the same on every processor, see engine.portable."""
PORTABLE = "portable"
ALL = ("nnan", "ninf", "nsz", "arcp", "contract", "afn", "reassoc")
"""All liberties, for kernels that never meet NaN or infinity."""
_ESTIMATES = {"arcp", "afn"}


def fast_math(*flags: str) -> set[str]:
    """numba's `fastmath` for some of LLVM's flags: those that this process may use. Kernels are compiled once, so it
    is read from the environment with which the process began."""
    return set(flags) - (_ESTIMATES if os.environ.get(CPU_VARIABLE) == PORTABLE else set())
