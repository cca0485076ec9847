"""How far each point of a moving surface goes until the next frame, from optical flow in every camera that sees it.

Optical flow is OpenCV's dense inverse search; a point's motion in space is the one that explains the flow of most of
its cameras (iteratively reweighted least squares), and points take the median of their neighbours.
Source: Kroeger et al., "Fast Optical Flow using Dense Inverse Search", ECCV 2016.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import KDTree

from engine.camera.projection import image_jacobians
from engine.parallel import map_ordered

WORKING_WIDTH = 640
"""Wider pictures are made smaller first, px."""
MARGIN_PX = 16
"""Around what moves, in working pixels: as much of the picture is looked at."""
MIN_CAMERAS = 2
N_NEIGHBORS = 12
N_ROUNDS = 6
SOFT_PX = 0.7
"""Flow that is off by this counts half."""
_RIDGE = 1e-3
"""Of the mean square of how a point's image moves: along a ray that all cameras share, nothing is known."""


def picture_flow(before: np.ndarray, after: np.ndarray, is_moving: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """How far pixels of one camera move until the next frame.

    Args:
        before, after: The camera's picture at both frames. [H, W, 3] uint8
        is_moving: Pixels that move in either. [H, W] bool
        pixel: Flat indices of pixels among them. [n] int64
    Returns:
        Columns and rows, px. [n, 2] float32
    """
    height, width = is_moving.shape
    step = max(1, round(width / WORKING_WIDTH))
    rows, columns = np.flatnonzero(is_moving.any(1)), np.flatnonzero(is_moving.any(0))
    margin = MARGIN_PX * step
    top, bottom = max(rows[0] - margin, 0), min(rows[-1] + 1 + margin, height)
    left, right = max(columns[0] - margin, 0), min(columns[-1] + 1 + margin, width)
    size = max((right - left) // step, MARGIN_PX), max((bottom - top) // step, MARGIN_PX)
    grays = [cv2.cvtColor(picture[top:bottom, left:right], cv2.COLOR_RGB2GRAY) for picture in (before, after)]
    small = [cv2.resize(gray, size, interpolation=cv2.INTER_AREA) for gray in grays]
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(small[0], small[1], None)  # pyright: ignore
    scale = np.array([(right - left) / size[0], (bottom - top) / size[1]])
    y, x = (pixel // width - top) / scale[1], (pixel % width - left) / scale[0]
    found = flow[np.minimum(y.astype(int), size[1] - 1), np.minimum(x.astype(int), size[0] - 1)]
    return (found * scale).astype(np.float32)


def surface_flow(
    points: np.ndarray,
    pixel: np.ndarray,
    is_visible: np.ndarray,
    pictures: tuple[np.ndarray, np.ndarray],
    masks: np.ndarray,
    projections: np.ndarray,
) -> np.ndarray:
    """How far surface points go until the next frame.

    Args:
        points: Of the surface in this frame, scene units. [P, 3]
        pixel, is_visible: Where cameras see them, from `hull_visibility`. [C, P]
        pictures: Of all cameras in this frame and the next. [C, H, W, 3] uint8 each
        masks: Pixels that move in either. [C, H, W] bool
        projections: [C, 3, 4]
    Returns:
        Scene units; 0 where too few cameras tell. [P, 3] float64
    """
    cv2.setNumThreads(1)  # each camera has a thread here
    is_used = is_visible & (pixel >= 0)

    def seen_by(camera: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rows = is_used[camera].nonzero()[0]
        if len(rows) == 0:
            return rows, np.zeros((0, 2, 3)), np.zeros((0, 2))
        flow = picture_flow(pictures[0][camera], pictures[1][camera], masks[camera], pixel[camera, rows])
        return rows, image_jacobians(points[rows], projections[camera]), flow.astype(np.float64)

    seen = map_ordered(seen_by, range(len(projections)))
    rows, jacobians, flows = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    is_known = np.bincount(rows, minlength=len(points)) >= MIN_CAMERAS
    if is_known.sum() < N_NEIGHBORS:
        return np.zeros((len(points), 3))
    steps = _explain(rows, jacobians, flows, len(points))
    _, near = KDTree(points[is_known]).query(points, k=N_NEIGHBORS)
    return np.median(steps[is_known][near], axis=1)


def _explain(rows: np.ndarray, jacobians: np.ndarray, flows: np.ndarray, n_points: int) -> np.ndarray:
    """The step of each point that explains the flow seen of it. [n_points, 3]

    Args:
        rows: Point of each observation. [E]
        jacobians: How its image moves with it, px a scene unit. [E, 2, 3]
        flows: How its image moved, px. [E, 2]
    """

    def summed(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(values), -1)
        sums = [np.bincount(rows, column, n_points) for column in flat.T]
        return np.stack(sums, axis=1).reshape(n_points, *values.shape[1:])

    squares, products = np.einsum("eij,eik->ejk", jacobians, jacobians), np.einsum("eij,ei->ej", jacobians, flows)
    weights, steps = np.ones(len(rows)), np.zeros((n_points, 3))
    for _ in range(N_ROUNDS):
        matrices = summed(weights[:, None, None] * squares)
        ridge = _RIDGE * np.trace(matrices, axis1=1, axis2=2) + 1e-9
        right = summed(weights[:, None] * products)
        steps = np.linalg.solve(matrices + ridge[:, None, None] * np.eye(3), right[..., None])[..., 0]
        off = np.linalg.norm(np.einsum("eij,ej->ei", jacobians, steps[rows]) - flows, axis=1)
        weights = 1.0 / (1.0 + (off / SOFT_PX) ** 2)
    return steps
