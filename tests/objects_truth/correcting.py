"""Correcting an object as a user does: one lasso in the worst frame, of what is missing or of what is too much."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from engine.editing.edit import Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.scene_object import ObjectSeed, SeedView
from engine.editing.selection.in_picture import under_mask
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.visibility import seen_rows
from tests.objects_truth.measuring import MOST, moments, projected, shown
from tests.objects_truth.oracle import picked_rows
from tests.objects_truth.selecting import SLACK_PX, lasso_seed
from tests.objects_truth.truth import ObjectsTruth


def correction(
    edited: EditedClip, views: dict[str, SeenFrom], truth: ObjectsTruth, name: str, picked: Picked, *, every: int = 1
) -> ObjectSeed:
    """One lasso in the camera and frame of a clip in which most pixels are missing from the object, or too much.

    What is missing is added by a lasso round the whole object, what is too much is removed by one round that alone;
    visible Gaussians only.

    Args:
        edited: The clip.
        views: The cameras to choose from, see `views_of`.
        truth: Of the capture.
        name: Of the object.
        picked: What is taken for it so far.
        every: So many frames lie from one that is looked at to the next.
    """
    is_picked, label = edited.rows.is_picked(picked), truth.label(name)
    most, frame, camera, too_much = -1, edited.clip.start, next(iter(views)), np.zeros((0, 0), bool)
    for frame_index, found in moments(edited, every=every):
        chosen = is_picked[edited.rows.indices_of(found.rows)]
        for one, view in views.items():
            mask, drawn = truth.labels[one][frame_index] == label, shown(found, view, chosen) > MOST
            extra = drawn & np.logical_not(binary_dilation(mask, iterations=SLACK_PX))
            n_missing, n_extra = np.count_nonzero(mask & ~drawn), np.count_nonzero(extra)
            if max(n_missing, n_extra) > most:
                most, frame, camera = max(n_missing, n_extra), frame_index, one
                too_much = extra if n_extra > n_missing else np.zeros_like(extra)
    if not too_much.any():
        return lasso_seed(edited, {camera: views[camera]}, truth, name, frame)
    found = edited.decode(edited.clip.clip_time(frame))
    seen = projected(found, views[camera])
    is_extra = under_mask(seen, too_much) & seen_rows(seen, found.gaussians.opacities.numpy())
    is_removed = np.zeros(edited.rows.n, bool)
    is_removed[edited.rows.indices_of(found.rows)[is_extra]] = True
    return ObjectSeed(frame, removed=picked_rows(edited, is_removed), view=SeedView.of(views[camera]))
