"""A trained clip and what its pictures are made with: the gains, near plane and spacing of the state it is based on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.clip import Clip
from engine.clip_files.array_names import GAINS
from engine.clip_files.clip_state import ClipState
from engine.model.clip_model import ClipModel
from engine.model.clip_view import REACH_SPACINGS, View, render_model


@dataclass(frozen=True, slots=True)
class TrainedClip:
    """A clip that can be seen through the cameras of its capture.

    Attributes:
        clip: Its frames.
        model: Its model.
        base: State with the colour gains, near plane and spacing: of the reference clip, or the clip's own where it
            inherits nothing.
    """

    clip: Clip
    model: ClipModel
    base: ClipState

    def picture(self, rig: CameraRig, camera: int, clip_time: float) -> np.ndarray:
        """What a camera of the rig sees, in its own colours where they are known. Not clamped. [H, W, 3] float32"""
        header = self.base.header
        width, height = (int(v) for v in rig.image_sizes[camera])
        view = View.from_arrays(
            rig.world_to_camera[camera], rig.Ks[camera], width=width, height=height, near_plane=header.near_plane
        )
        image = render_model(self.model, view, clip_time, reach=REACH_SPACINGS * header.spacing).numpy()
        return image * camera_gain(self.base, rig.names[camera])


def camera_gain(base: ClipState, camera_name: str) -> np.ndarray:
    """Colour gain of a training camera; of a held-out one the best guess, ones: the median camera's. [3] float32"""
    names = base.header.camera_names
    if camera_name in names:
        return base.arrays[GAINS][names.index(camera_name)]
    return np.ones(3, np.float32)
