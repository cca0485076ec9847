"""Compile every kernel that training and viewing use, in several processes at once.

Compiling holds the interpreter lock for seconds, so it never happens in a process with a window, and on the first
start alone. Two programs that start at once do not compile twice: the second one waits for the first.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from engine.kernels.cache import MARKER, VARIABLE, current_key, kernel_folder, read_marker, write_marker
from engine.own_modules import import_own, module_name, python_path
from engine.parallel import n_cores

if TYPE_CHECKING:
    from filelock import BaseFileLock

logger = logging.getLogger(__name__)

GROUPS = (
    ("point clouds", "engine.cloud.warm", 8.8),
    ("decoder", "engine.backends.cpu.decode.warm", 4.1),
    ("rasterizer", "engine.backends.cpu.raster.warm", 4.9),
    ("loss and optimiser", "engine.backends.cpu.step.warm", 5.0),
    ("figures", "engine.metrics.pictures.warm", 4.0),
    ("view modes", "engine.backends.inspection.warm", 1.5),
    ("selection", "engine.editing.selection.warm", 4.0),
)
"""Name, module, and about how long compiling takes, of each group. Every module has a `warm_up()` that runs each of its
kernels once. Groups share no cached kernel but the entry of `routines.run`, or two processes would compile it at the
same time."""
OF_CPU = ("decoder", "rasterizer", "loss and optimiser")
"""Groups of the back end "cpu"; the others are used whatever the back end."""
SHARED_MARKER = "warm-shared.json"
"""Beside the marker of all groups: that of the others alone."""

MAX_PROCESSES = 4
TIME_LIMIT_S = 180.0
POLL_S = 0.05
LOCK = "compiling.lock"

ReportGroups = Callable[[int, int, str], None]
"""Groups done, groups in all, and what is compiled now. Called often; may raise to cancel."""


def load_groups_of_cpu(*, is_training: bool) -> None:
    """Load the groups of the back end "cpu" into this process, a fraction of a second, or compile what is not yet.

    Args:
        is_training: Whether steps follow, or pictures alone.
    """
    for name, module, _ in GROUPS:
        if name in OF_CPU and (is_training or name == "rasterizer"):
            import_own(module).warm_up()


def compile_all(report: ReportGroups | None = None, *, backend: str = "cpu", n_processes: int | None = None) -> bool:
    """Compile every group in other processes, unless that was done: about ten seconds on two cores.

    A group that fails is logged and left to its first use.

    Args:
        report: Called with the progress; what it raises ends the compiling processes and passes on.
        backend: The backend to compute with; groups of another one are left out.
        n_processes: How many at a time; as many as cores when None, MAX_PROCESSES at most.
    Returns:
        Whether all of them succeeded.
    """
    groups = tuple(group for group in GROUPS if backend == "cpu" or group[0] not in OF_CPU)
    marker = MARKER if len(groups) == len(GROUPS) else SHARED_MARKER
    folder = kernel_folder()
    if _is_done(folder, marker):
        return True
    report = report or (lambda done, n, what: None)
    n = len(groups)
    lock = _take(folder / LOCK)
    while lock is not None and not lock.is_locked:
        report(0, n, "another program compiles")
        time.sleep(POLL_S)
        lock = _take(folder / LOCK)
    running: list[tuple[_Bundle, subprocess.Popen[bytes], float]] = []
    n_done, is_fine = 0, True
    try:
        if _is_done(folder, marker):  # the program we waited for has done it
            return True
        for bundle in _bundles(groups, min(n_processes or n_cores(), MAX_PROCESSES)):
            running.append((bundle, _start(bundle, folder), time.monotonic()))
        while running:
            report(n_done, n, " and ".join(_names(bundle) for bundle, _, _ in running))
            time.sleep(POLL_S)
            for item in list(running):
                bundle, process, started_s = item
                seconds = time.monotonic() - started_s
                if process.poll() is None and seconds < TIME_LIMIT_S:
                    continue
                running.remove(item)
                n_done += len(bundle)
                is_fine &= _end(_names(bundle), process, seconds)
        report(n_done, n, "")
        if is_fine:
            write_marker(folder, marker)
        return is_fine
    finally:
        for _, process, _ in running:
            process.kill()
            process.communicate()
        if lock is not None:
            with suppress(OSError):
                lock.release()


def _is_done(folder: Path, marker: str) -> bool:
    return any(read_marker(folder, name) == current_key() for name in (MARKER, marker))


_Bundle = tuple[tuple[str, str, float], ...]
"""Groups that one process compiles, one after the other."""


def _bundles(groups: _Bundle, n_processes: int) -> list[_Bundle]:
    """Longest first, each to the process that has least to do."""
    bundles: list[_Bundle] = [()] * min(n_processes, len(groups))
    for group in sorted(groups, key=lambda group: -group[2]):
        least = min(range(len(bundles)), key=lambda i: sum(seconds for _, _, seconds in bundles[i]))
        bundles[least] = (*bundles[least], group)
    return bundles


def _names(bundle: _Bundle) -> str:
    return ", ".join(name for name, _, _ in bundle)


_IMPORT = "from importlib import import_module"
_END_WITH_PARENT = f"from {module_name('engine.kernels.parent')} import end_with_parent; end_with_parent()"
"""A compiler that nobody waits for takes a core for a minute all the same."""


def _start(bundle: _Bundle, folder: Path) -> subprocess.Popen[bytes]:
    calls = "; ".join(f"import_module({module_name(module)!r}).warm_up()" for _, module, _ in bundle)
    return subprocess.Popen(
        # a compiler makes millions of objects that live on: looking for garbage among them takes a fifth of the time
        [sys.executable, "-P", "-c", f"{_END_WITH_PARENT}; import gc; gc.disable(); {_IMPORT}; {calls}"],
        env={**os.environ, "PYTHONPATH": python_path(), VARIABLE: str(folder)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def _end(name: str, process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Collect a process that has ended or taken too long; whether it succeeded."""
    process.kill()
    _, said = process.communicate()
    if process.returncode == 0:
        logger.info("kernels of the %s compiled in %.1f s", name, seconds)
        return True
    reason = said.decode("utf-8", "replace").strip()[-2000:] or f"exit status {process.returncode}, no message"
    logger.warning("kernels of the %s could not be compiled ahead: %s", name, reason)
    return False


def _take(path: Path) -> BaseFileLock | None:
    """The system's lock on a file, which ends with this process; `is_locked` says whether it is ours now.

    None where no lock can be made: compiling twice is better than never.
    """
    from filelock import FileLock, Timeout  # only where there is something to compile

    lock = FileLock(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout:
        return lock
    except OSError:
        return None
    return lock
