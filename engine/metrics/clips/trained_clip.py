"""A trained clip and what its pictures are made with: near plane and spacing of the state it is based on, and the
colours of the cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.clip import Clip
from engine.clip_files.array_names import GAINS
from engine.clip_files.clip_state import ClipState
from engine.model.camera_colors import CameraColors
from engine.model.clip_model import ClipModel
from engine.model.clip_view import REACH_SPACINGS, View, render_model
from engine.model.host_array import host_array


@dataclass(frozen=True, slots=True)
class TrainedClip:
    """A clip that can be seen through the cameras of its capture.

    Attributes:
        clip: Its frames.
        model: Its model.
        base: State with the colour gains, near plane and spacing: of the reference clip, or the clip's own where it
            inherits nothing.
        drift: Exposure of the training cameras, see engine.model.camera_colors.
    """

    clip: Clip
    model: ClipModel
    base: ClipState
    drift: np.ndarray | None = None

    @property
    def colors(self) -> CameraColors:
        """What the cameras make of the scene's colours in this clip."""
        header = self.base.header
        return CameraColors(tuple(header.camera_names), self.base.arrays[GAINS], self.drift, self.clip.clip_length)

    def picture(self, rig: CameraRig, camera: int, clip_time: float) -> np.ndarray:
        """What a camera of the rig sees, in its own colours where they are known. Not clamped. [H, W, 3] float32"""
        header = self.base.header
        width, height = (int(v) for v in rig.image_sizes[camera])
        view = View.from_arrays(
            rig.world_to_camera[camera], rig.Ks[camera], width=width, height=height, near_plane=header.near_plane
        )
        image = render_model(self.model, view, clip_time, reach=REACH_SPACINGS * header.spacing)
        return self.colors.in_camera(host_array(image), rig, camera, clip_time)
