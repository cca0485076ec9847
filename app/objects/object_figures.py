"""How well an object is shown: PSNR over its own pixels in the pictures of all cameras."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from engine.editing.scene_object import SceneObject

LEAST_SHARE = 0.5
"""Pixels of which it makes up more than this in the render are its own."""


@dataclass(slots=True)
class _Sum:
    """Of the pictures of some cameras."""

    n_pictures: int = 0
    n_pixels: int = 0
    squared_error: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """PSNR of all its pixels together, dB, null where it is not seen."""
        psnr = None
        if self.n_pixels:
            mean = max(self.squared_error / self.n_pixels, 1e-10)
            psnr = -10.0 * math.log10(mean)
        return {"psnr": psnr, "pictures": self.n_pictures, "pixels": self.n_pixels}


def object_figures(
    opened: TrainedProject,
    one: SceneObject,
    clip_indices: Sequence[int],
    on_progress: Callable[[int, int], None] = lambda n_done, n_all: None,
) -> dict[str, Any]:
    """Measure an object in trained clips, over the pictures in which it is seen.

    Args:
        clip_indices: Of clips that are trained.
        on_progress: Told how many pictures are done, of how many; its exceptions end the work.
    Returns:
        JSON-able: object (its name), least_share, and clips, by index: held_out and trained_on, each with psnr (dB
        over all pixels of the object in those pictures; null where there are none), pictures and pixels.
    Raises:
        ProjectError: A clip is not trained, or damaged.
    """
    use_threads(None)
    opened = opened.measured
    capture, rig = opened.capture, opened.capture.rig
    holdout = set(capture.camera_indices(opened.project.settings.holdout))
    frames = {index: [*filter(one.is_seen, opened.clips[index].frame_indices())] for index in clip_indices}
    n_all, n_done = sum(len(found) * len(rig) for found in frames.values()), 0
    clips: dict[str, Any] = {}
    for index in clip_indices:
        sums = {"held_out": _Sum(), "trained_on": _Sum()}
        measuring = _ClipObject(opened, one, index)
        for camera in range(len(rig)):
            for frame in frames[index]:
                on_progress(n_done, n_all)
                n_done += 1
                if capture.is_usable(camera, frame):
                    measuring.add(sums["held_out" if camera in holdout else "trained_on"], camera, frame)
        clips[str(index)] = {group: found.as_dict() for group, found in sums.items()}
    on_progress(n_done, n_all)
    return {"object": one.name, "least_share": LEAST_SHARE, "clips": clips}


class _ClipObject:
    """An object in one loaded clip."""

    def __init__(self, opened: TrainedProject, one: SceneObject, clip_index: int) -> None:
        self._opened, self._one = opened, one
        self._trained = opened.load(clip_index)
        self._edited = opened.edited(self._trained)

    def add(self, total: _Sum, camera: int, frame: int) -> None:
        """Add the pixels of one picture to a sum."""
        import numpy as np

        from engine.images.psnr import squared_error
        from engine.metrics.pictures.colors import as_shown

        capture = self._opened.capture
        mask = self._mask(camera, frame)
        valid = capture.valid_in(camera, frame)
        mask = mask if valid is None else mask & valid
        if not mask.any():
            return
        clip_time = self._trained.clip.clip_time(frame)
        image = as_shown(self._trained.picture(capture.rig, camera, clip_time), "float")
        truth = capture.frame(camera, frame).astype(np.float32) / np.float32(255.0)
        total.n_pictures += 1
        total.n_pixels += int(mask.sum())
        total.squared_error += float(squared_error(image, truth)[mask].sum())

    def _mask(self, camera: int, frame: int) -> Any:
        """The pixels of a picture that are its own. [H, W] bool"""
        import torch

        from engine.model.clip_view import render_gaussians
        from engine.model.host_array import host_array
        from engine.raster.gaussians import Gaussians

        edited = self._edited.decode(self._trained.clip.clip_time(frame))
        rows = self._edited.rows
        is_in = rows.is_picked(self._one.picked(frame))[rows.indices_of(edited.rows)]
        found = edited.gaussians
        marked = torch.as_tensor(is_in, dtype=found.colors.dtype, device=found.colors.device)[:, None].expand(-1, 3)
        lit = Gaussians(found.means, found.quats, found.scales, found.opacities, marked.contiguous())
        view = self._trained.view(self._opened.capture.rig, camera)
        with torch.no_grad():
            picture = render_gaussians(lit, view, backend=self._trained.model.backend).image[0]
        return host_array(picture)[..., 0] > LEAST_SHARE
