"""Among which processes an id means one process: those of one run of a kernel, apart in each of its containers."""

from __future__ import annotations

import os
import platform
from functools import cache
from hashlib import sha256
from pathlib import Path


@cache
def boot_id() -> str:
    """Distinguishes this run of the system's kernel, which containers share, from others. Empty where unknown."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    except (OSError, ValueError):
        return ""


def pid_space() -> str:
    """Within which process ids mean the same process on this computer; empty where the system has one space only."""
    try:
        return os.readlink("/proc/self/ns/pid")
    except OSError:
        return ""


@cache
def process_space() -> str:
    """Eight characters that other computers and containers have otherwise."""
    return sha256(f"{boot_id() or platform.node()} {pid_space()}".encode()).hexdigest()[:8]
