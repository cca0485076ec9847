"""Truth for a real capture: boxes and spheres round its objects, frame by frame, set by hand and checked in pictures.

Masks come from the trained clips themselves: a pixel shows an object where Gaussians with their centres in its
volumes make up most of it. They say which Gaussians belong together, not how good the training is.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.editing.edited_clip import EditedClip, EditedGaussians
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.share import selected_share
from tests.objects_truth.measuring import MOST, moments, projected
from tests.objects_truth.truth import ObjectsTruth


@dataclass(frozen=True, slots=True)
class Volumes:
    """Where objects are, scene units.

    Attributes:
        objects: Their names; where volumes overlap, the later one counts.
        frames: For each frame, by name, either `boxes` (lowest and highest corner each) or `center` and `radius`.
    """

    objects: tuple[str, ...]
    frames: list[dict[str, Any]]

    def labels(self, frame_index: int, means: np.ndarray) -> np.ndarray:
        """1 + number of the object that holds each point [N, 3], 0 for none. [N] uint8"""
        labels = np.zeros(len(means), np.uint8)
        for number, name in enumerate(self.objects):
            labels[_is_inside(self.frames[frame_index][name], means)] = number + 1
        return labels


def read_volumes(path: Path) -> Volumes:
    """Read them from JSON."""
    document = json.loads(path.read_text(encoding="utf-8"))
    return Volumes(tuple(document["objects"]), document["frames"])


def truth_in_volumes(clips: Iterable[EditedClip], views: dict[str, SeenFrom], volumes: Volumes) -> ObjectsTruth:
    """Masks in some cameras; frames of clips that are not given show nothing. Views: at the size of the masks."""
    n_frames, n_objects = len(volumes.frames), len(volumes.objects)
    sizes = {camera: (n_frames, view.height, view.width) for camera, view in views.items()}
    labels = {camera: np.zeros(size, np.uint8) for camera, size in sizes.items()}
    behind = {camera: np.zeros((n_objects, *size), np.uint8) for camera, size in sizes.items()}
    for clip in clips:
        for frame_index, found in moments(clip):
            of_gaussian = volumes.labels(frame_index, found.gaussians.means.numpy())
            for camera, view in views.items():
                labels[camera][frame_index] = _picture(found, view, of_gaussian, range(1, n_objects + 1))
                for number in range(n_objects):
                    rest = [label for label in range(1, n_objects + 1) if label != number + 1]
                    behind[camera][number, frame_index] = _picture(found, view, of_gaussian, rest, number + 1)
    return ObjectsTruth(volumes.objects, labels, behind)


def _is_inside(volume: dict[str, Any], means: np.ndarray) -> np.ndarray:
    if "radius" in volume:
        return np.linalg.norm(means - np.array(volume["center"]), axis=1) <= volume["radius"]
    boxes = np.array(volume["boxes"])
    return np.any([((low <= means) & (means <= high)).all(1) for low, high in boxes], axis=0)


def _picture(
    found: EditedGaussians, view: SeenFrom, of_gaussian: np.ndarray, labels: Sequence[int], without: int = 0
) -> np.ndarray:
    """The label that makes up most of each pixel, with one of them taken away. [H, W] uint8"""
    seen, opacities = projected(found, view), found.gaussians.opacities.numpy()
    opacities = np.where((of_gaussian == without) & (without > 0), 0.0, opacities)
    picture = np.zeros((view.height, view.width), np.uint8)
    for label in labels:
        picture[selected_share(seen, opacities, of_gaussian == label) > MOST] = label
    return picture
