"""Each camera's rendition of the scene's colours: its gain, its vignetting, and its exposure in each frame of a clip.

They are known of a camera that was trained on. One that was held out is shown with the gain and the vignetting of the
median camera, and with the exposure that its place and direction suggest: cameras that look at the same things from the
same side change their exposure alike. Scenes are stored, exported and freely viewed in their own colours; this is for
the comparison with captured pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.images.rendition import Rendition, typical_vignetting

RIDGE = 0.3
"""Weight of the penalty on slopes, in cameras: chosen on the training cameras of a real capture, each left out once,
where it leaves a third less error than the median of the others; values from 0.1 to 1 differ by a fiftieth."""


@dataclass(frozen=True, slots=True)
class CameraColors:
    """Colours of the cameras of one clip.

    Attributes:
        camera_names: Training cameras, rows of the arrays.
        gains: camera_colour = gain * scene_colour in the reference clip. [C, 3]
        drift: Exposure in each frame against the reference clip; None where it does not change. [C, M, 3]
        clip_length: M that clip times count in.
        vignetting: Of the lenses, see engine.images.rendition; None where they have none. [C, 2]
    """

    camera_names: tuple[str, ...]
    gains: np.ndarray
    drift: np.ndarray | None
    clip_length: int
    vignetting: np.ndarray | None = None

    def gain(self, camera_name: str) -> np.ndarray:
        """The gain of one camera in the reference clip; ones for a held-out camera. [3] float32"""
        if camera_name in self.camera_names:
            return self.gains[self.camera_names.index(camera_name)]
        return np.ones(3, np.float32)

    def exposure(self, rig: CameraRig, camera: int, clip_time: float) -> np.ndarray:
        """Exposure of one camera of a rig at a time of the clip, interpolated between frames. [3] float32

        Args:
            rig: With the training cameras and this one.
        """
        if self.drift is None:
            return np.ones(3, np.float32)
        position = min(max(clip_time * self.clip_length, 0.0), self.drift.shape[1] - 1.0)
        before = int(position)
        after, weight = min(before + 1, self.drift.shape[1] - 1), np.float32(position - before)
        at_time = (1 - weight) * self.drift[:, before] + weight * self.drift[:, after]
        name = rig.names[camera]
        if name in self.camera_names:
            return at_time[self.camera_names.index(name)]
        return exposure_elsewhere(rig, [rig.names.index(known) for known in self.camera_names], at_time, camera)

    def in_camera(self, image: np.ndarray, rig: CameraRig, camera: int, clip_time: float) -> np.ndarray:
        """A picture in the scene's colours as the camera takes it, white staying white. [H, W, 3] float"""
        return self.rendition(rig, camera, clip_time).to_camera(image)

    def rendition(self, rig: CameraRig, camera: int, clip_time: float) -> Rendition:
        """Gain, exposure and vignetting together."""
        gain = self.gain(rig.names[camera]) * self.exposure(rig, camera, clip_time)
        return Rendition.of(gain, self._vignetting_of(rig.names[camera]), rig.Ks[camera], rig.image_sizes[camera])

    def _vignetting_of(self, camera_name: str) -> np.ndarray | None:
        if self.vignetting is None or camera_name not in self.camera_names:
            return None if self.vignetting is None else typical_vignetting(self.vignetting)
        return self.vignetting[self.camera_names.index(camera_name)]


def exposure_elsewhere(rig: CameraRig, known: list[int], exposures: np.ndarray, camera: int) -> np.ndarray:
    """Exposure that other cameras suggest for one: linear in place and direction, as far as these bear it out.

    Args:
        rig: All cameras.
        known: Cameras whose exposure is known.
        exposures: Theirs. [C, 3]
        camera: The one that is asked for.
    Returns:
        Within the range of the known ones, by channel. [3] float32
    """
    poses = rig.world_to_camera.astype(np.float64)
    centers = -np.einsum("cji,cj->ci", poses[:, :3, :3], poses[:, :3, 3])
    spread = float(np.sqrt(((centers - centers.mean(0)) ** 2).sum(1).mean())) or 1.0
    features = np.concatenate([centers / spread, poses[:, 2, :3]], axis=1)
    logs = np.log(exposures.astype(np.float64))
    at_known, mean = features[known] - features[known].mean(0), logs.mean(0)
    slopes = np.linalg.solve(at_known.T @ at_known + RIDGE * np.eye(6), at_known.T @ (logs - mean))
    suggested = mean + (features[camera] - features[known].mean(0)) @ slopes
    return np.exp(np.clip(suggested, logs.min(0), logs.max(0))).astype(np.float32)
