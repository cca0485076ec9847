"""The light of a source clip: on its static anchors where it meets its neighbours, and in pictures of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch

from engine.camera.rig import CameraRig
from engine.clip_files.roles import STATIC
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.light import WINDOW_FRAMES, AnchorLight, joined, met_by_plain, steady, taken_over
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View, render_gaussians
from engine.model.host_array import host_array
from engine.progress import Progress, ReportProgress
from engine.training.preparation.cloud_preparation import Backgrounds
from engine.training.preparation.training_pictures import TrainingPictures

STAGE = "Measuring light"
_DARK = 0.03
"""Sum over RGB of a render below which its brightness says nothing."""


def measure_light(
    model: ClipModel,
    pictures: TrainingPictures,
    rig: CameraRig,
    backgrounds: Backgrounds,
    exposures: Sequence[Exposure] | None,
    report: ReportProgress,
    *,
    plain: range,
    is_looking_ahead: bool = True,
) -> None:
    """Give a model that inherits static anchors the light on them at the start and the end of its clip.

    Args:
        model: Of a clip; one whose static anchors change over time, or that has none, stays as it is.
        pictures: Of the clip, in the exposure of the backgrounds.
        rig: Training cameras.
        backgrounds: Their pictures in the reference clip when nothing moves.
        exposures: That of each background; None where no camera's exposure is looked at.
        report: Gets one line.
        plain: Frames of the reference clip, which is drawn in no light but its own.
        is_looking_ahead: Whether frames behind the clip may be looked at. If not, it begins in the light in which the
            clip before ends, instead of both meeting half way.
    """
    if STATIC not in model.roles():
        return
    anchors = model.anchor_set(STATIC)
    if anchors.is_dynamic:
        return
    clip, n_frames = pictures.clip, pictures.capture.n_frames
    points = host_array(anchors.positions).astype(np.float64)
    measure = AnchorLight(points, rig, backgrounds.images)

    def light_in(start: int, stop: int) -> np.ndarray:
        return measure.at(_frames_in(range(start, stop), pictures, exposures))

    first = light_in(clip.start, clip.start + WINDOW_FRAMES)
    last = light_in(clip.stop - WINDOW_FRAMES, clip.stop)
    middle = (clip.start + clip.stop - WINDOW_FRAMES) // 2
    half_way = light_in(middle, middle + WINDOW_FRAMES)

    def joined_at(border: int, beside: range, own: np.ndarray) -> np.ndarray:
        if border in (plain.start, plain.stop):
            return met_by_plain(own)
        if not 0 < border < n_frames or (border == clip.stop and not is_looking_ahead):
            return own
        other = light_in(beside.start, beside.stop)
        return joined(other, own) if is_looking_ahead else taken_over(other, own)

    start = joined_at(clip.start, range(clip.start - WINDOW_FRAMES, clip.start), first)
    stop = joined_at(clip.stop, range(clip.stop, clip.stop + WINDOW_FRAMES), last)
    logs = steady(start, half_way, stop)
    share = 100 * float((logs != 0).any(1).mean())
    if share:
        model.light = torch.from_numpy(logs)
    said = f"it differs from the reference clip's on {share:.1f} % of the static anchors"
    report(Progress(STAGE, 1.0, said if share else "as in the reference clip"))


def _frames_in(
    frames: range, pictures: TrainingPictures, exposures: Sequence[Exposure] | None
) -> Callable[[int], list[np.ndarray]]:
    """Camera row to its pictures of some frames, as far as the capture has them, in the backgrounds' exposure."""
    clip, capture = pictures.clip, pictures.capture
    inside = [index for index in frames if index in clip.frame_indices()]
    outside = [index for index in frames if index not in clip.frame_indices() and 0 <= index < capture.n_frames]

    def frames_of(row: int) -> list[np.ndarray]:
        camera = pictures.camera_indices[row]
        used = [index for index in inside if capture.is_usable(camera, index)]
        own = [pictures.picture(row, index - clip.start) for index in used]
        beside = [index for index in outside if capture.is_usable(camera, index)]
        if not beside:
            return own
        others = capture.frames_of(camera, beside)
        return [*own, *(others if exposures is None else exposures[row].applied_to(others))]

    return frames_of


def brightness_in(model: ClipModel, views: Sequence[View]) -> Callable[[int, int], np.ndarray]:
    """The factor by which light changes still parts: (row of the views, frame in clip) -> [H, W, 1] float32."""
    times = (0.0, model.n_frames / model.clip_length)
    ends = [np.stack([_light_in(model, view, clip_time) for clip_time in times]) for view in views]

    def brightness(row: int, frame_in_clip: int) -> np.ndarray:
        weights = model.light_weights(frame_in_clip / model.clip_length)
        return np.tensordot(np.array(weights, np.float32), ends[row], 1)

    return brightness


def _light_in(model: ClipModel, view: View, clip_time: float) -> np.ndarray:
    still = model.static_gaussians(STATIC)
    with torch.no_grad():
        plain, lit = (
            host_array(render_gaussians(gaussians, view, backend=model.backend).image[0]).sum(-1, keepdims=True)
            for gaussians in (still, model.in_light(still, clip_time))
        )
    return np.where(plain > _DARK, lit / np.maximum(plain, _DARK), 1.0).astype(np.float32)
