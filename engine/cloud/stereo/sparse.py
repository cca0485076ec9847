"""Sparse points from SIFT matches and the known poses, by pycolmap in a child process of its own.

pycolmap installs native signal handlers and, imported before Python's zlib, breaks it; neither must
reach this process. Arrays cross as .npz files; there is no pickle. A failure costs the points, never the job: they only
set depth ranges, and the coarse sweep can do that too.

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
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import engine
from engine.camera.rig import CameraRig
from engine.storage.files import disk_error

STALL_S = 300.0
"""A child that has used no processor time for so long hangs."""
POLL_S = 0.2
N_ATTEMPTS = 2
"""A child that was killed or hung gets another chance: what kills it, as too little memory, need not do so again."""
MAX_CAMERAS = 48
"""Of more cameras so many are matched, spread over all: every pair of them is, and depth ranges need no more."""
MIN_POINTS = 30
"""Fewer points than this are noise."""
FOLDER_PREFIX = "clipgstream-sparse-"


@dataclass(frozen=True, slots=True)
class SparsePoints:
    """Triangulated points. points [P, 3] float64 world; colors [P, 3] float32 0..1; errors [P] reprojection px."""

    points: np.ndarray
    colors: np.ndarray
    errors: np.ndarray

    @staticmethod
    def none() -> SparsePoints:
        """No points."""
        return SparsePoints(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.float32), np.zeros(0))


def triangulate(
    images: np.ndarray,
    rig: CameraRig,
    *,
    is_valid: np.ndarray | None = None,
    report: Callable[[str], None],
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> SparsePoints:
    """Match SIFT features between cameras, all of them up to MAX_CAMERAS, and triangulate them with the rig's poses.

    Args:
        images: One picture per camera. [C, H, W, 3] uint8
        rig: At the size of the images.
        is_valid: Pixels that the cameras see, None for all; features near others are edges of nothing. [C, H, W] bool
        report: Gets one line with the count, or with the reason why there are no points.
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Returns:
        SparsePoints with reprojection error below 2 px, ordered by position; empty if fewer than MIN_POINTS were
        found, or the child failed.
    Raises:
        DiskError: There is no room for the pictures that the child reads.
    """
    remove_leftovers()
    try:
        folder = Path(tempfile.mkdtemp(prefix=f"{FOLDER_PREFIX}{os.getpid()}-"))
    except OSError as error:
        raise disk_error(error, what="The pictures for matching", path=tempfile.gettempdir()) from error
    try:
        job, result = folder / "job.npz", folder / "result.npz"
        try:
            rows = np.unique(np.linspace(0, len(rig) - 1, min(len(rig), MAX_CAMERAS)).round().astype(int))
            seen = np.zeros(0, bool) if is_valid is None else is_valid[rows]  # empty: all of it
            poses = rig.world_to_camera[rows]
            np.savez(job, images=images[rows], Ks=rig.Ks[rows], world_to_camera=poses, is_valid=seen)
        except OSError as error:
            raise disk_error(error, what="The pictures for matching", path=job) from error
        reason, is_final = "", False
        for _ in range(N_ATTEMPTS):
            reason, is_final = _run_child(job, result, alive, stall_s)
            if not reason or is_final:
                break
        if reason:
            report(f"Sparse points: none, {reason}; depth ranges come from a coarse sweep instead")
            return SparsePoints.none()
        with np.load(result) as arrays:
            points, colors, errors = arrays["points"], arrays["colors"], arrays["errors"]
            n_features = int(arrays["n_features"])
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    is_good = np.isfinite(points).all(axis=1) & (errors < 2.0)
    points, colors, errors = points[is_good], colors[is_good], errors[is_good]
    if len(points) < MIN_POINTS:
        report(f"Sparse points: only {len(points)} of {n_features} features could be triangulated; not used")
        return SparsePoints.none()
    order = np.lexsort(points.T)  # the child's ids depend on thread timing
    points, colors, errors = points[order], colors[order], errors[order]
    report(f"Sparse points: {len(points)} from {n_features} SIFT features, median error {np.median(errors):.2f} px")
    return SparsePoints(points, colors.astype(np.float32), errors)


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


def _run_child(job: Path, result: Path, alive: Callable[[], None], stall_s: float) -> tuple[str, bool]:
    """Run the triangulation: why there is no result, or an empty string, and whether it would be so again."""
    root = str(Path(engine.__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    beat, said = job.with_name("beat"), job.with_name("said.txt")
    command = [sys.executable, "-m", "engine.cloud.stereo.sparse_child", str(job), str(result), str(beat)]
    with said.open("wb") as errors:
        try:
            # the child holds the other end of this pipe: it ends by itself when nobody holds ours any more
            child = subprocess.Popen(
                command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
            )
        except OSError as error:
            return f"the triangulation process could not be started ({error})", True
        try:
            has_ended = _wait_for(child, beat, alive, stall_s)
        finally:
            child.kill()
            child.wait()
            assert child.stdin is not None
            child.stdin.close()
    if not has_ended:
        return f"the triangulation process did nothing for {stall_s:.0f} s", False
    if child.returncode != 0 or not result.exists():
        lines = said.read_text(errors="replace").strip().splitlines()
        reason = (
            f"the triangulation process ended with code {child.returncode} ({lines[-1] if lines else 'no message'})"
        )
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
