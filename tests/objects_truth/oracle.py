"""The best picks that masks allow: each Gaussian belongs to what it is seen as in all evaluated cameras and frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.conventions import ALPHA_MAX, ALPHA_MIN
from engine.editing.edit import PickedRows
from engine.editing.edited_clip import EditedClip
from engine.editing.picks import pack_rows
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.visibility import footprint
from tests.objects_truth.measuring import STILL_ROLES, moments, projected
from tests.objects_truth.truth import ObjectsTruth

N_ROUNDS = 3
"""Gaussians inside of an object are seen only when those in front of them are gone."""


@dataclass(frozen=True, slots=True)
class Oracle:
    """What masks say of the Gaussians of a clip.

    Attributes:
        is_object: By index, see ClipRows. [n] bool
        weights: Share of each role in the pixels of the object; the picture's light, which adds up to 1 or less.
    """

    is_object: np.ndarray
    weights: dict[str, float]


def find_oracle(edited: EditedClip, views: dict[str, SeenFrom], truth: ObjectsTruth, name: str) -> Oracle:
    """The Gaussians of roles that move which are seen as the object more than as anything else.

    Args:
        edited: The clip.
        views: The evaluated cameras, see `views_of`.
        truth: Of the capture.
        name: Of the object.
    """
    label = truth.label(name)
    is_object = np.zeros(edited.rows.n, bool)
    weights: dict[str, float] = {}
    for number in range(N_ROUNDS):
        votes, n_pixels = np.zeros((edited.rows.n, len(truth.objects) + 1)), 0
        for frame_index, found in moments(edited):
            index = edited.rows.indices_of(found.rows)
            opacities = np.where(is_object[index], 0.0, found.gaussians.opacities.numpy().astype(np.float64))
            for camera, view in views.items():
                labels = truth.labels[camera][frame_index]
                if number:
                    behind = truth.behind[camera][label - 1, frame_index]
                    labels = np.where((labels == label) & (behind > 0), behind, labels)
                n_pixels += np.count_nonzero(labels == label)
                seen = projected(found, view)
                rows = np.flatnonzero(seen.is_before & (opacities >= ALPHA_MIN))
                order = rows[np.argsort(seen.depths[rows])]
                left = np.ones(labels.shape, np.float32)
                _vote(seen.centers, seen.spreads, opacities, order, index, labels, left, votes)
        if number == 0:
            weights = {one.role: float(votes[edited.rows.set_of == i, label].sum()) / max(n_pixels, 1)
                       for i, one in enumerate(edited.rows.sets)}  # fmt: skip
        roles = np.array([one.role not in STILL_ROLES for one in edited.rows.sets], bool)
        is_new = (votes[:, label] > 0) & (votes.argmax(1) == label) & roles[edited.rows.set_of] & ~is_object
        is_object |= is_new
        if not is_new.any():
            break
    return Oracle(is_object, weights)


def picked_rows(edited: EditedClip, is_chosen: np.ndarray) -> tuple[PickedRows, ...]:
    """Gaussians of a clip, by index, in the form of a document. is_chosen: [n] bool"""
    found = edited.rows.named(np.flatnonzero(is_chosen))
    return tuple(
        PickedRows(one.clip_index, one.origin, one.role, pack_rows(found.number[found.set_index == place]))
        for place, one in enumerate(found.sets)
        if (found.set_index == place).any()
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _vote(centers, spreads, opacities, order, index, labels, left, votes):
    """From front to back, each Gaussian votes with the light that it gives for the labels of the pixels it is in."""
    height, width = labels.shape
    for k in range(len(order)):
        i = order[k]
        limit = np.log(opacities[i] / ALPHA_MIN)
        u, v, ixx, ixy, iyy, _, _, _, first_x, last_x, first_y, last_y = footprint(
            centers, spreads, np.sqrt(2.0 * limit), i, 1.0, height, width
        )
        for row in range(first_y, last_y + 1):
            dy = row + 0.5 - v
            for column in range(first_x, last_x + 1):
                dx = column + 0.5 - u
                power = 0.5 * (ixx * dx * dx + iyy * dy * dy) + ixy * dx * dy
                if power > limit:
                    continue
                alpha = np.float32(min(opacities[i] * np.exp(-power), ALPHA_MAX))
                votes[index[i], labels[row, column]] += alpha * left[row, column]
                left[row, column] *= np.float32(1.0) - alpha
