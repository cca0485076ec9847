"""Memory of this process."""

from __future__ import annotations

import sys
from contextlib import suppress


def peak_bytes(*, is_reset: bool = False) -> int:
    """Most memory this process ever held, bytes; since now if it can be reset.

    On Linux the kernel's high-water mark of this very process: ru_maxrss begins at the size of the parent.
    """
    if sys.platform == "linux":
        if is_reset:
            with suppress(OSError), open("/proc/self/clear_refs", "w", encoding="ascii") as file:
                file.write("5")
        with suppress(OSError, ValueError, StopIteration), open("/proc/self/status", encoding="ascii") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))
    try:
        import resource
    except ImportError:  # Windows
        raise NotImplementedError("peak memory is not known on this system") from None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def peak_mb() -> float | None:
    """Most memory this process ever held, 10^6 bytes; None where unknown."""
    with suppress(NotImplementedError):
        return round(peak_bytes() / 1e6, 1)
    return None
