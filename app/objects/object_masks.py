"""Where an object is in the pictures of all cameras, as painted masks: what training does not see of it.

A mask covers all frames of a clip in which the object was found, and a margin around it. In clips that are not trained
yet nobody knows where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.objects.object_figures import LEAST_SHARE
from app.objects.searching import Report
from engine.capture.exclusions import PaintedMask, Stroke
from engine.editing.scene_object import SceneObject
from engine.errors import ProjectError

EVERY_FRAMES, MARGIN_PX = 2, 3
"""It is looked at in every so many frames; the margin is in pixels of the small picture in which it is looked."""
PITCH_PX = 4
"""Height of a stroke, in such pixels."""
DIGITS = 4


def object_masks(
    opened: TrainedProject, one: SceneObject, report: Report = lambda done, total: None
) -> tuple[PaintedMask, ...]:
    """Find the masks of an object, in the clips in which it was found.

    Args:
        report: Told how many pictures are done, of how many; its exceptions end the work.
    Returns:
        One for each clip and camera in which it is seen; some kilobytes each.
    Raises:
        ProjectError: It was found nowhere, or a clip is damaged.
    """
    use_threads(None)
    opened = opened.measured
    trained = set(opened.trained)
    clips = [clip for clip in opened.clips if clip.clip_index in trained and _frames(one, clip.frame_indices())]
    if not clips:
        raise ProjectError(
            f"{one.name} was found in no clip, so that nobody knows what to leave out.", hint="Find it again first."
        )
    rig = opened.capture.rig
    found: list[PaintedMask] = []
    for number, clip in enumerate(clips):
        trained_clip = opened.load(clip.clip_index)
        edited = opened.edited(trained_clip)
        frames = _frames(one, clip.frame_indices())
        covered: list[np.ndarray | None] = [None] * len(rig)
        for place, frame in enumerate(frames):
            decoded = edited.decode(clip.clip_time(frame))
            is_in = edited.rows.is_picked(one.picked(frame))[edited.rows.indices_of(decoded.rows)]
            for camera in range(len(rig)):
                report(number + (place + camera / len(rig)) / len(frames), len(clips))
                share = _share(trained_clip, rig, camera, decoded.gaussians, is_in)
                known = covered[camera]
                covered[camera] = share if known is None else known | share
        for camera, mask in enumerate(covered):
            if mask is not None and (strokes := strokes_of(_widened(mask))):
                found.append(PaintedMask(rig.names[camera], clip.start, clip.stop, strokes, one.object_id))
    report(len(clips), len(clips))
    return tuple(found)


def strokes_of(mask: np.ndarray) -> tuple[Stroke, ...]:
    """Strokes of a brush that cover a mask, one for each run in a band of rows. mask: [h, w] bool"""
    height, width = mask.shape
    radius = 0.75 * PITCH_PX  # reaches over the corners of its band
    strokes = []
    for top in range(0, height, PITCH_PX):
        band = mask[top : top + PITCH_PX].any(0)
        edges = np.flatnonzero(np.diff(np.r_[False, band, False].astype(np.int8)))
        y = round((top + PITCH_PX / 2) / height, DIGITS)
        for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            x0, x1 = (round(x / width, DIGITS) for x in (first, stop))
            strokes.append(Stroke(((x0, y), (x1, y)), radius / width))
    return tuple(strokes)


def _frames(one: SceneObject, frames: Sequence[int] | range) -> list[int]:
    """Those in which it is, a few of them."""
    seen = [frame for frame in frames if one.is_seen(frame) and one.picked(frame).sets]
    return sorted({*seen[::EVERY_FRAMES], *seen[-1:]})


def _widened(mask: np.ndarray) -> np.ndarray:
    from scipy.ndimage import binary_dilation

    return binary_dilation(mask, iterations=MARGIN_PX)


def _share(trained: Any, rig: Any, camera: int, gaussians: Any, is_in: np.ndarray) -> np.ndarray:
    """Where a camera sees it, in a small picture. [h, w] bool"""
    from engine.editing.selection.projected import project_gaussians
    from engine.editing.selection.seen_from import SeenFrom
    from engine.editing.selection.share import selected_share
    from engine.model.host_array import host_array

    own = trained.rig(rig)
    width, height = (int(side) for side in own.image_sizes[camera])
    near = trained.base.header.near_plane
    view = SeenFrom(own.world_to_camera[camera], own.Ks[camera], width, height, near)
    means, quats, scales, opacities, _ = (host_array(tensor) for tensor in gaussians.tensors())
    return selected_share(project_gaussians(means, quats, scales, view), opacities, is_in) > LEAST_SHARE
