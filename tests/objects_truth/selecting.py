"""Selecting an object as a user does: a lasso round it in one frame, what is seen through it, from one side or more."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from engine.editing.edited_clip import EditedClip
from engine.editing.scene_object import ObjectSeed, SeedView
from engine.editing.selection.in_picture import under_mask
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.visibility import seen_rows
from tests.objects_truth.measuring import projected
from tests.objects_truth.oracle import picked_rows
from tests.objects_truth.truth import ObjectsTruth

SLACK_PX = 1
"""By so much the lasso goes round the object."""


def lasso_seed(
    edited: EditedClip, views: dict[str, SeenFrom], truth: ObjectsTruth, name: str, frame_index: int
) -> ObjectSeed:
    """What lassos round an object select in a frame, visible Gaussians only.

    Args:
        edited: The clip of the frame.
        views: Those in which it is selected, by camera; the search is told of a single one.
        truth: Of the capture.
        name: Of the object.
        frame_index: The frame.
    """
    found = edited.decode(edited.clip.clip_time(frame_index))
    opacities, index = found.gaussians.opacities.numpy(), edited.rows.indices_of(found.rows)
    is_chosen = np.zeros(edited.rows.n, bool)
    for camera, view in views.items():
        mask = truth.labels[camera][frame_index] == truth.label(name)
        seen = projected(found, view)
        lasso = binary_dilation(mask, iterations=SLACK_PX) if mask.any() else mask
        is_chosen[index[under_mask(seen, lasso) & seen_rows(seen, opacities)]] = True
    view = SeedView.of(next(iter(views.values()))) if len(views) == 1 else None
    return ObjectSeed(frame_index, picked_rows(edited, is_chosen), view=view)
