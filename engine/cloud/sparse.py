"""Sparse points from SIFT matches and the known poses, by pycolmap in a child process of its own.

pycolmap installs native signal handlers and, imported before Python's zlib, breaks it; neither must
reach this process. Arrays cross as .npz files; there is no pickle. A failure costs the points, never the job: they only
set depth ranges, and the coarse sweep can do that too.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import engine
from engine.capture.rig import CameraRig

TIME_LIMIT_S = 90.0
MIN_POINTS = 30
"""Fewer points than this are noise."""


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
    images: np.ndarray, rig: CameraRig, *, report: Callable[[str], None], time_limit_s: float = TIME_LIMIT_S
) -> SparsePoints:
    """Match SIFT features between all cameras and triangulate them with the rig's poses.

    Args:
        images: One picture per camera. [C, H, W, 3] uint8
        rig: At the size of the images.
        report: Gets one line with the count, or with the reason why there are no points.
    Returns:
        SparsePoints with reprojection error below 2 px, ordered by position; empty if fewer than MIN_POINTS were
        found, or the child failed or took longer than time_limit_s.
    """
    with tempfile.TemporaryDirectory(prefix="clipgstream-sparse-") as folder:
        job, result = Path(folder) / "job.npz", Path(folder) / "result.npz"
        np.savez(job, images=images, Ks=rig.Ks, world_to_camera=rig.world_to_camera)
        reason = _run_child(job, result, time_limit_s)
        if reason:
            report(f"Sparse points: none, {reason}; depth ranges come from a coarse sweep instead")
            return SparsePoints.none()
        with np.load(result) as arrays:
            points, colors, errors = arrays["points"], arrays["colors"], arrays["errors"]
            n_features = int(arrays["n_features"])
    is_good = np.isfinite(points).all(axis=1) & (errors < 2.0)
    points, colors, errors = points[is_good], colors[is_good], errors[is_good]
    if len(points) < MIN_POINTS:
        report(f"Sparse points: only {len(points)} of {n_features} features could be triangulated; not used")
        return SparsePoints.none()
    order = np.lexsort(points.T)  # the child's ids depend on thread timing
    points, colors, errors = points[order], colors[order], errors[order]
    report(f"Sparse points: {len(points)} from {n_features} SIFT features, median error {np.median(errors):.2f} px")
    return SparsePoints(points, colors.astype(np.float32), errors)


def _run_child(job: Path, result: Path, time_limit_s: float) -> str:
    """Run the triangulation; the reason why there is no result, or an empty string."""
    root = str(Path(engine.__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", "engine.cloud.sparse_child", str(job), str(result)]
    try:
        run = subprocess.run(command, env=environment, capture_output=True, timeout=time_limit_s, check=False)
    except subprocess.TimeoutExpired:
        return f"triangulation took longer than {time_limit_s:.0f} s"
    except OSError as error:
        return f"the triangulation process could not be started ({error})"
    if run.returncode != 0 or not result.exists():
        lines = run.stderr.decode(errors="replace").strip().splitlines()
        return f"the triangulation process ended with code {run.returncode} ({lines[-1] if lines else 'no message'})"
    return ""
