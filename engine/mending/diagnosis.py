"""The cause of a jump at a boundary: still parts, in their light or in the cameras' colours, or moving ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
import torch

from engine.capture.capture import Capture
from engine.clip_files.roles import STATIC
from engine.mending.stretch import Stretch
from engine.metrics.clips.seams import change_of, excess_of, stands_still
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import render_gaussians, visible_rows
from engine.model.host_array import host_array

_N_CAMERAS = 6
_LIKELY_SHARE = 0.1
_TOUCHED = 0.5 / 255.0
"""Where static anchors alone show the same within this, nothing that can move has a part in the picture."""


class SeamDiagnosis(msgspec.Struct, frozen=True):
    """Mean excess change of pixels that stand still, from one frame to the next, in 1/255.

    Attributes:
        all: Of the picture as cameras show it.
        still: The part of it that lies where static anchors alone show, in the scene's colours: their light.
        colors: The amount that cameras' colours add to the change of the picture in the scene's colours.
    """

    all: float
    still: float
    colors: float

    @property
    def is_light_likely(self) -> bool:
        """Whether measuring exposure and light again may help."""
        return self.still + self.colors > _LIKELY_SHARE * self.all

    @property
    def words(self) -> str:
        """In a sentence."""
        if self.all <= 0.0:
            return "Static parts do not jump."
        if self.colors > max(self.still, 0.5 * self.all):
            return "Colours of single cameras jump."
        if self.still > 0.5 * self.all:
            return "The light on static parts jumps."
        return "Moving anchors jump where nothing moves."


def diagnose(
    capture: Capture, clips: Mapping[int, TrainedClip], stretch: Stretch, cameras: Sequence[int]
) -> SeamDiagnosis:
    """Look at the worst pair of a stretch: a boundary, or all of its pairs together.

    Args:
        clips: By index.
        cameras: Of which some are looked through.
    """
    chosen = np.linspace(0, len(cameras) - 1, min(len(cameras), _N_CAMERAS)).round().astype(int)
    found = []
    for frame in stretch.pairs:
        shown = [_clip_of(clips, at) for at in (frame - 1, frame)]
        if shown[0] is None or shown[1] is None:
            continue
        for camera in (cameras[i] for i in chosen):
            found.append(_of_pair(capture, (shown[0], shown[1]), frame, camera))
    everything, still, plain = np.mean(found, axis=0) if found else np.zeros(3)
    return SeamDiagnosis(float(everything), float(still), float(max(everything - plain, 0.0)))


def _clip_of(clips: Mapping[int, TrainedClip], frame: int) -> TrainedClip | None:
    return next((one for one in clips.values() if one.clip.start <= frame < one.clip.stop), None)


def _of_pair(
    capture: Capture, shown: tuple[TrainedClip, TrainedClip], frame: int, camera: int
) -> tuple[float, float, float]:
    truths = [capture.frame(camera, at).astype(np.float32) / np.float32(255.0) for at in (frame - 1, frame)]
    truth_change = change_of(truths[1], truths[0])
    is_still = stands_still(truth_change)
    for at in (frame - 1, frame):
        valid = capture.valid_in(camera, at)
        if valid is not None:
            is_still &= valid
    if not is_still.any():
        return 0.0, 0.0, 0.0
    pictures = [_pictures(one, capture, camera, at) for one, at in zip(shown, (frame - 1, frame), strict=True)]
    (shown_then, still_then, plain_then), (shown_now, still_now, plain_now) = pictures

    def excess(earlier: np.ndarray, later: np.ndarray, where: np.ndarray) -> float:
        values = excess_of(change_of(later, earlier), truth_change)
        return 255.0 * float(np.where(where, values, 0.0).sum() / is_still.sum())

    is_bare = (change_of(still_then, plain_then) < _TOUCHED) & (change_of(still_now, plain_now) < _TOUCHED)
    return (
        excess(shown_then, shown_now, is_still),
        excess(still_then, still_now, is_still & is_bare),
        excess(plain_then, plain_now, is_still),
    )


def _pictures(trained: TrainedClip, capture: Capture, camera: int, frame: int) -> tuple[np.ndarray, ...]:
    """As the camera shows it, static anchors alone, and in the scene's colours. [H, W, 3] each"""
    rig, clip_time = capture.rig, trained.clip.clip_time(frame)
    model, view = trained.model, trained.view(rig, camera)
    rows = visible_rows(model, view, clip_time, reach=trained.reach)
    nothing = {role: rows[role] if role == STATIC else rows[role][:0] for role in rows}
    with torch.no_grad():
        plain, still = (
            host_array(render_gaussians(model.decode(clip_time, part), view, backend=model.backend).image[0])
            for part in (rows, nothing)
        )
    return trained.colors.in_camera(plain, rig, camera, clip_time), still, plain
