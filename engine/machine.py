"""What this machine has."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def memory_bytes() -> int | None:
    """Memory of the machine; None where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def free_memory_bytes(root: Path = Path("/")) -> int | None:
    """Memory that new processes may take without anything being swapped out: of the machine, or of what a container or
    a batch job may use. None where the system does not say, as outside Linux.

    Args:
        root: Of the file system; tests bring their own.
    """
    with suppress(OSError, ValueError, StopIteration):
        lines = (root / "proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
        return max(min((free, *_left_in_groups(root))), 0)
    return None


def _left_in_groups(root: Path) -> Iterator[int]:
    """What is left of the limit of each control group of this process, in either version of them."""
    with suppress(OSError):
        for line in (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            _, controllers, name = line.split(":", 2)
            if controllers == "":
                place, names = root / "sys/fs/cgroup", ("memory.max", "memory.current", "inactive_file")
            elif "memory" in controllers.split(","):
                place = root / "sys/fs/cgroup/memory"
                names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
            else:
                continue
            group = place / name.strip("/")  # does not exist where a container sees its own group as the top
            for folder in (group, *group.parents):
                if folder.is_relative_to(place):
                    with suppress(OSError, ValueError):  # "max" means without a limit
                        yield _left_in_group(folder, *names)


def _left_in_group(folder: Path, limit: str, usage: str, cache: str) -> int:
    rows = dict(line.split() for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines())
    used = int((folder / usage).read_text(encoding="ascii")) - int(rows.get(cache, 0))  # the cache goes when asked
    return int((folder / limit).read_text(encoding="ascii")) - used


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
