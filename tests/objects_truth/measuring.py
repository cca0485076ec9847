"""How well picked Gaussians are an object: what they cover, what is left of it without them, and what others lose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.editing.actions import Delete
from engine.editing.edit import Picked
from engine.editing.edited_clip import EditedClip, EditedGaussians
from engine.editing.effects import NO_EFFECTS, Effect, Effects
from engine.editing.selection.projected import ProjectedGaussians, project_gaussians
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.share import selected_share
from tests.objects_truth.truth import ObjectsTruth

STILL_ROLES = ("static", "promoted", "replacing")
"""Roles of anchors that stay where they are."""
MOST = 0.5
"""A pixel shows what makes up more than this share of it."""


@dataclass(frozen=True, slots=True)
class ClipFigures:
    """Pixels of all evaluated cameras and frames of a clip.

    Attributes:
        clip_index: Which clip.
        n_true: Pixels that show the object.
        n_drawn: Pixels that show picked Gaussians.
        n_both: Pixels that do both.
        n_clear: Pixels of the object with no other object behind them.
        n_left: So many of those still show something that moves when the picks are deleted.
        n_others: Pixels of other objects that moving Gaussians show.
        n_lost: So many of those no longer do when the picks are deleted.
        lowest: IoU of the worst frame; None without the object.
    """

    clip_index: int
    n_true: int
    n_drawn: int
    n_both: int
    n_clear: int
    n_left: int
    n_others: int
    n_lost: int
    lowest: float | None

    @property
    def iou(self) -> float | None:
        """Intersection over union, pixels of all frames taken together; None in a clip without the object."""
        return self.n_both / (self.n_true + self.n_drawn - self.n_both) if self.n_true else None

    @property
    def left(self) -> float | None:
        """Share of the object that deletion leaves."""
        return self.n_left / self.n_clear if self.n_clear else None

    @property
    def lost(self) -> float | None:
        """Share of other objects that deletion takes."""
        return self.n_lost / self.n_others if self.n_others else None


def views_of(truth: ObjectsTruth, rig: CameraRig, *, near: float) -> dict[str, SeenFrom]:
    """The evaluated cameras at the size of their masks, by name."""
    width, height = truth.size
    views = {}
    for camera in truth.labels:
        i = rig.names.index(camera)
        K = np.diag([width / rig.image_sizes[i, 0], height / rig.image_sizes[i, 1], 1.0]) @ rig.Ks[i]
        views[camera] = SeenFrom(rig.world_to_camera[i], K, width, height, near)
    return views


def clip_figures(
    edited: EditedClip, views: dict[str, SeenFrom], truth: ObjectsTruth, name: str, picked: Picked, *, every: int = 1
) -> ClipFigures:
    """Measure picks in one clip.

    Args:
        edited: The clip.
        views: The evaluated cameras, see `views_of`.
        truth: Of the capture.
        name: Of the object.
        picked: Its Gaussians.
        every: So many frames lie from one that is looked at to the next.
    """
    deletion, label = Effects.made([Effect(picked, Delete())]), truth.label(name)
    is_picked = edited.rows.is_picked(picked)
    sums, lowest = np.zeros(7, np.int64), []
    for frame_index, whole in moments(edited, every=every):
        rest = edited.decode(edited.clip.clip_time(frame_index), deletion)
        chosen = is_picked[edited.rows.indices_of(whole.rows)]
        n_both = n_either = 0
        for camera, view in views.items():
            labels, behind = truth.labels[camera][frame_index], truth.behind[camera][label - 1, frame_index]
            seen, opacities = projected(whole, view), whole.gaussians.opacities.numpy()
            drawn, moved = (selected_share(seen, opacities, which) > MOST for which in (chosen, is_moving(whole)))
            moves = shown(rest, view, is_moving(rest)) > MOST
            is_true, is_other = labels == label, (labels != label) & (labels != 0) & moved
            is_clear = is_true & (behind == 0)
            counted = (is_true, drawn, is_true & drawn, is_clear, is_clear & moves, is_other, is_other & ~moves)
            sums += [np.count_nonzero(pixels) for pixels in counted]
            n_both += np.count_nonzero(is_true & drawn)
            n_either += np.count_nonzero(is_true | drawn) if is_true.any() else 0
        if n_either:
            lowest.append(n_both / n_either)
    return ClipFigures(edited.clip.clip_index, *(int(n) for n in sums), lowest=min(lowest, default=None))


def moments(edited: EditedClip, *, every: int = 1) -> Iterator[tuple[int, EditedGaussians]]:
    """The frames of a clip without edits, or every second one and so on: frame_index and Gaussians."""
    for frame_index in range(edited.clip.start, edited.clip.stop, every):
        yield frame_index, edited.decode(edited.clip.clip_time(frame_index), NO_EFFECTS)


def is_moving(found: EditedGaussians) -> np.ndarray:
    """Whether each Gaussian is of a role that moves. [N] bool"""
    return np.array([one.role not in STILL_ROLES for one in found.rows.sets], bool)[found.rows.set_index]


def projected(found: EditedGaussians, view: SeenFrom) -> ProjectedGaussians:
    """Gaussians in the picture of a view."""
    gaussians = found.gaussians
    return project_gaussians(gaussians.means.numpy(), gaussians.quats.numpy(), gaussians.scales.numpy(), view)


def shown(found: EditedGaussians, view: SeenFrom, chosen: np.ndarray) -> np.ndarray:
    """Share of each pixel that chosen Gaussians make up. chosen: [N] bool. [H, W]"""
    return selected_share(projected(found, view), found.gaussians.opacities.numpy(), chosen)
