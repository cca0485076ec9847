"""Sparse points from SIFT matches and the known poses, by pycolmap in a child process of its own.

A failure costs the points, never the job: they only set depth ranges, and the coarse sweep can do that too.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.children.kind import STALL_S, ChildFailed
from engine.features.child import arrays_kind, work_on_arrays
from engine.images.image_filters import erode

logger = logging.getLogger(__name__)

MAX_CAMERAS = 48
"""Of more cameras so many are matched, spread over all: every pair of them is, and depth ranges need no more."""
MIN_POINTS = 30
"""Fewer points than this are noise."""
MASK_MARGIN_PX = 6
"""Features so near to pixels that the camera does not see may be the edge between both."""
TRIANGULATION = arrays_kind(
    "engine.cloud.stereo.sparse:TRIANGULATION", "engine.cloud.stereo.sparse_child:main", "the triangulation process"
)


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
    rows = np.unique(np.linspace(0, len(rig) - 1, min(len(rig), MAX_CAMERAS)).round().astype(int))
    job = {"images": images[rows], "Ks": rig.Ks[rows], "world_to_camera": rig.world_to_camera[rows]}
    if is_valid is not None:
        job["is_valid"] = np.stack([erode(valid, MASK_MARGIN_PX) for valid in is_valid[rows]])
    try:
        found = work_on_arrays(TRIANGULATION, job, alive=alive, stall_s=stall_s)
    except ChildFailed as error:
        report(f"Sparse points: none, {error}; depth ranges come from a coarse sweep instead")
        return SparsePoints.none()
    points, colors, errors, n_features = found["points"], found["colors"], found["errors"], int(found["n_features"])
    is_good = np.isfinite(points).all(axis=1) & (errors < 2.0)
    points, colors, errors = points[is_good], colors[is_good], errors[is_good]
    if len(points) < MIN_POINTS:
        report(f"Sparse points: only {len(points)} of {n_features} features could be triangulated; not used")
        return SparsePoints.none()
    order = np.lexsort(points.T)  # the child's ids depend on thread timing
    points, colors, errors = points[order], colors[order], errors[order]
    report(f"Sparse points: {len(points):,}, typical error {np.median(errors):.2f} px")
    logger.info("sparse points come from %d features", n_features)
    return SparsePoints(points, colors.astype(np.float32), errors)
