"""What this machine has."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


def memory_bytes() -> int | None:
    """Memory of the machine; None where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def processor_text() -> str:
    """Maker, model and instruction sets of the first core, as the system reports them; a few lines at most."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            wanted = ("vendor_id", "cpu family", "model", "flags", "Features", "CPU part", "CPU implementer", "isa")
            lines = []
            for line in file:
                if not line.strip() and lines:  # end of the first core: the rest repeats it
                    break
                if line.startswith(wanted):
                    lines.append(line)
            return "".join(lines)
    except OSError:
        import platform

        return " ".join((platform.machine(), os.environ.get("PROCESSOR_IDENTIFIER", ""), _mac_brand()))


def _mac_brand() -> str:
    if sys.platform != "darwin":
        return ""
    import ctypes

    with suppress(OSError, AttributeError):
        value, size = ctypes.create_string_buffer(256), ctypes.c_size_t(256)
        library = ctypes.CDLL(None)
        if library.sysctlbyname(b"machdep.cpu.brand_string", value, ctypes.byref(size), None, 0) == 0:
            return value.value.decode("utf-8", "replace")
    return ""
