"""A trained clip and what its pictures are made with: near plane and spacing of the state it is based on, and the
colours of the cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.corrections import corrected
from engine.camera.rig import CameraRig
from engine.capture.clip import Clip
from engine.clip_files.array_names import CORRECTIONS, GAINS, VIGNETTING
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
        base: State with the colour gains, vignetting, near plane and spacing: of the reference clip, or the clip's
            own where it inherits nothing.
        drift: Exposure of the training cameras, see engine.model.camera_colors.
    """

    clip: Clip
    model: ClipModel
    base: ClipState
    drift: np.ndarray | None = None

    @classmethod
    def of_state(
        cls, clip: Clip, model: ClipModel, state: ClipState, reference: ClipState | None
    ) -> TrainedClip | None:
        """A loaded state of a clip; None where its files do not say what the cameras make of the scene's colours.

        Args:
            reference: The clip that it inherits from; None for one that inherits nothing.
        """
        base = state if state.is_reference or reference is None else reference
        gains = base.arrays.get(GAINS)
        if gains is None or len(gains) != len(base.header.camera_names):
            return None
        needed = {name: base.arrays[name] for name in (GAINS, CORRECTIONS, VIGNETTING) if name in base.arrays}
        return cls(clip, model, ClipState(needed, base.header), state.drift)

    @property
    def colors(self) -> CameraColors:
        """The cameras' renditions of the scene's colours in this clip."""
        header = self.base.header
        names, gains = tuple(header.camera_names), self.base.arrays[GAINS]
        return CameraColors(names, gains, self.drift, self.clip.clip_length, self.base.vignetting)

    @property
    def beyond(self) -> float:
        """Clip time of the frame after the last one: that of the next clip's first frame."""
        return self.clip.n_frames / self.clip.clip_length

    @property
    def is_held_beyond(self) -> bool:
        """Whether the clip answers with its last frame when it is asked beyond it, because its field ends there."""
        return self.model.knots(self.beyond) == self.model.knots(self.clip.clip_time(self.clip.stop - 1))

    @property
    def ahead(self) -> float:
        """Clip time of the frame before the first one."""
        return -1.0 / self.clip.clip_length

    @property
    def is_held_ahead(self) -> bool:
        """Whether the clip answers with its first frame when it is asked for the one before it."""
        return self.model.knots(self.ahead) == self.model.knots(0.0)

    @property
    def reach(self) -> float:
        """How far Gaussians are expected from their anchors, scene units."""
        return REACH_SPACINGS * self.base.header.spacing

    def rig(self, rig: CameraRig) -> CameraRig:
        """The capture's cameras as the clip was trained with them; the same object where none was corrected."""
        return corrected(rig, self.base.header.camera_names, self.base.corrections)

    def view(self, rig: CameraRig, camera: int) -> View:
        """The view of a camera of the capture's rig, corrected where it was refined in training."""
        rig = self.rig(rig)
        width, height = (int(v) for v in rig.image_sizes[camera])
        near_plane = self.base.header.near_plane
        return View.from_arrays(
            rig.world_to_camera[camera], rig.Ks[camera], width=width, height=height, near_plane=near_plane
        )

    def picture(self, rig: CameraRig, camera: int, clip_time: float) -> np.ndarray:
        """The picture of a rig's camera, in its own colours where they are known. Not clamped. [H, W, 3] float32"""
        image = render_model(self.model, self.view(rig, camera), clip_time, reach=self.reach)
        return self.colors.in_camera(host_array(image), rig, camera, clip_time)
