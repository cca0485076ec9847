"""Compile, or load from the cache, every kernel that selects."""

from __future__ import annotations

import numpy as np

from engine.editing.selection.in_picture import under_mask
from engine.editing.selection.neighbours import flooded, grown
from engine.editing.selection.projected import project_gaussians
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.shapes import brush_mask, lasso_mask
from engine.editing.selection.share import selected_share
from engine.editing.selection.visibility import seen_rows
from engine.editing.volumes.outlines import in_outline


def warm_up() -> None:
    """Run every kernel once, on two Gaussians and a picture of a few pixels."""
    means = np.array([[0.0, 0.0, 2.0], [0.1, 0.0, 2.0]], np.float32)
    quats, scales = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (2, 1)), np.full((2, 3), 0.2, np.float32)
    view = SeenFrom(np.eye(4), np.array([[8.0, 0.0, 4.0], [0.0, 8.0, 4.0], [0.0, 0.0, 1.0]]), 8, 8)
    projected = project_gaussians(means, quats, scales, view)
    lasso_mask(np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0]]), view.size)
    under_mask(projected, brush_mask(np.array([[4.0, 4.0]]), 2.0, view.size), is_by_extent=True)
    seen_rows(projected, np.full(2, 0.9))
    selected_share(projected, np.full(2, 0.9), np.ones(2, np.bool_))
    in_outline(means[:, :2], ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)))
    grown(means, np.array([True, False]), 0.5)
    flooded(means, means, 0, 0.5, 1.0)
