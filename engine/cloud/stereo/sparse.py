"""Sparse points from SIFT matches and the known poses, by pycolmap in a child process of its own.

See engine.children.running for how the child is run. A failure costs the points, never the job: they only set depth
ranges, and the coarse sweep can do that too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.children.running import STALL_S, child_folder, run_child
from engine.storage.files import disk_error

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
    report: Callable[[str], None],
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> SparsePoints:
    """Match SIFT features between cameras, all of them up to MAX_CAMERAS, and triangulate them with the rig's poses.

    Args:
        images: One picture per camera. [C, H, W, 3] uint8
        rig: At the size of the images.
        report: Gets one line with the count, or with the reason why there are no points.
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Returns:
        SparsePoints with reprojection error below 2 px, ordered by position; empty if fewer than MIN_POINTS were
        found, or the child failed.
    Raises:
        DiskError: There is no room for the pictures that the child reads.
    """
    what = "The pictures for matching"
    with child_folder(FOLDER_PREFIX, what=what) as folder:
        job, result = folder / "job.npz", folder / "result.npz"
        try:
            rows = np.unique(np.linspace(0, len(rig) - 1, min(len(rig), MAX_CAMERAS)).round().astype(int))
            np.savez(job, images=images[rows], Ks=rig.Ks[rows], world_to_camera=rig.world_to_camera[rows])
        except OSError as error:
            raise disk_error(error, what=what, path=job) from error
        reason, is_final = "", False
        for _ in range(N_ATTEMPTS):
            reason, is_final = run_child(
                "engine.cloud.stereo.sparse_child",
                job,
                result,
                what="the triangulation process",
                alive=alive,
                stall_s=stall_s,
            )
            if not reason or is_final:
                break
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
