"""Running one module of the program in a process of its own, and a folder for what crosses.

For libraries that must not reach this process: pycolmap installs native signal handlers and, imported before Python's
zlib, breaks it. Arrays cross as files; there is no pickle.

A child may take as long as it works: a limit by the clock would make results depend on what else the machine does. It
is ended when it stands still, when this process is interrupted, and by itself when this process has died.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import engine
from engine.storage.files import disk_error

STALL_S = 300.0
"""A child that has used no processor time for so long hangs."""
POLL_S = 0.2
_IS_POSIX = os.name == "posix"
_NEW_GROUP = 0 if _IS_POSIX else getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
"""Ctrl+C in a terminal reaches the processes of the parent's group: a child that it ends while it still starts fails
like one that cannot do its work, and the parent would keep that for a result. So each child has a group of its own."""


@contextmanager
def child_folder(prefix: str, *, what: str) -> Iterator[Path]:
    """A temporary folder for what a child reads and writes; removed at the end. Those of killed processes go first.

    Args:
        prefix: Begins its name; no other use has the same.
        what: Subject of the message when the disk refuses.
    Raises:
        DiskError: There is no room for it.
    """
    remove_leftovers(prefix)
    try:
        folder = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}-"))
    except OSError as error:
        raise disk_error(error, what=what, path=tempfile.gettempdir()) from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers(prefix: str) -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        pid = folder.name.removeprefix(prefix).partition("-")[0]
        if pid.isdecimal() and os.name == "posix" and not _is_alive(int(pid)):
            shutil.rmtree(folder, ignore_errors=True)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # somebody else's, or no process id at all
        return True
    return True


def run_child(
    module: str,
    job: Path,
    result: Path,
    *,
    what: str,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> tuple[str, bool]:
    """Run `python -m module JOB RESULT BEAT` and wait for its end.

    Args:
        module: Calls engine.children.child.serve.
        job: What it reads; it may write beside it.
        result: What it leaves.
        what: What it is called in reasons, as "the triangulation process".
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Returns:
        Why there is no result, or an empty string; and whether it would be so again.
    """
    root = str(Path(engine.__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    # one thread per matrix product: children spread their work themselves, and sums keep their order on any machine
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(paths)}
    beat, said = job.with_name("beat"), job.with_name("said.txt")
    command = [sys.executable, "-m", module, str(job), str(result), str(beat)]
    with said.open("wb") as errors:
        try:
            # the child holds the other end of this pipe: it ends by itself when nobody holds ours any more
            child = subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                process_group=0 if _IS_POSIX else None,
                creationflags=_NEW_GROUP,
            )
        except OSError as error:
            return f"{what} could not be started ({error})", True
        try:
            has_ended = _wait_for(child, beat, alive, stall_s)
        finally:
            child.kill()
            child.wait()
            assert child.stdin is not None
            child.stdin.close()
    if not has_ended:
        return f"{what} did nothing for {stall_s:.0f} s", False
    if child.returncode != 0 or not result.exists():
        lines = said.read_text(errors="replace").strip().splitlines()
        reason = f"{what} ended with code {child.returncode} ({lines[-1] if lines else 'no message'})"
        return reason, child.returncode >= 0
    return "", True


def _wait_for(child: subprocess.Popen[bytes], beat: Path, alive: Callable[[], None], stall_s: float) -> bool:
    """Whether the child ended by itself; False when it stood still for too long."""
    still_s, last = 0.0, 0.0
    while True:
        started_s = time.monotonic()
        with suppress(subprocess.TimeoutExpired):
            child.wait(POLL_S)
            return True
        alive()
        with suppress(OSError):
            if (now := beat.stat().st_mtime) != last:
                still_s, last = 0.0, now
        # a machine that slept, or a group of processes that was halted, has not waited
        still_s += min(time.monotonic() - started_s, 1.0)
        if still_s > stall_s:
            return False
