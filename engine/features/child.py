"""Runs a module that uses pycolmap in a child process of its own; arrays cross as .npz files, there is no pickle.

pycolmap installs native signal handlers and, imported before Python's zlib, breaks it; neither must reach this
process.

The child may take as long as it works: a limit by the clock would make the result depend on what else the machine does.
It is ended when it stands still, when this process is interrupted, and by itself when this process has died.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

import engine
from engine.storage.files import disk_error

STALL_S = 300.0
"""A child that has used no processor time for so long hangs."""
POLL_S = 0.2
N_ATTEMPTS = 2
"""A child that was killed or hung gets another chance: what kills it, as too little memory, need not do so again."""
FOLDER_PREFIX = "clipgstream-sparse-"
WHAT = "The pictures for matching"


class ChildFailed(Exception):
    """There is no result; says why, as a part of a sentence."""


def run_child(
    module: str,
    arrays: Mapping[str, np.ndarray],
    *,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> dict[str, np.ndarray]:
    """Hand arrays to a module that ends with `engine.features.child_side.run_as_child`. Returns what it answers.

    Args:
        module: Its full name.
        arrays: By name.
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Raises:
        ChildFailed: The child could not be started, was killed, hung, or failed.
        DiskError: There is no room for what the child reads.
    """
    remove_leftovers()
    try:
        folder = Path(tempfile.mkdtemp(prefix=f"{FOLDER_PREFIX}{os.getpid()}-"))
    except OSError as error:
        raise disk_error(error, what=WHAT, path=tempfile.gettempdir()) from error
    try:
        job, result = folder / "job.npz", folder / "result.npz"
        try:
            np.savez(job, allow_pickle=False, **arrays)
        except OSError as error:
            raise disk_error(error, what=WHAT, path=job) from error
        reason, is_final = "", False
        for _ in range(N_ATTEMPTS):
            reason, is_final = _run_once(module, job, result, alive, stall_s)
            if not reason or is_final:
                break
        if reason:
            raise ChildFailed(reason)
        with np.load(result) as answer:
            return dict(answer)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers() -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{FOLDER_PREFIX}*"):
        pid = folder.name.removeprefix(FOLDER_PREFIX).partition("-")[0]
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


def _run_once(
    module: str, job: Path, result: Path, alive: Callable[[], None], stall_s: float
) -> tuple[str, bool]:
    """Run the child: why there is no result, or an empty string, and whether it would be so again."""
    root = str(Path(engine.__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    beat, said = job.with_name("beat"), job.with_name("said.txt")
    command = [sys.executable, "-m", module, str(job), str(result), str(beat)]
    with said.open("wb") as errors:
        try:
            # the child holds the other end of this pipe: it ends by itself when nobody holds ours any more
            child = subprocess.Popen(
                command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
            )
        except OSError as error:
            return f"the process for it could not be started ({error})", True
        try:
            has_ended = _wait_for(child, beat, alive, stall_s)
        finally:
            child.kill()
            child.wait()
            assert child.stdin is not None
            child.stdin.close()
    if not has_ended:
        return f"the process for it did nothing for {stall_s:.0f} s", False
    if child.returncode != 0 or not result.exists():
        lines = said.read_text(errors="replace").strip().splitlines()
        reason = f"the process for it ended with code {child.returncode} ({lines[-1] if lines else 'no message'})"
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
