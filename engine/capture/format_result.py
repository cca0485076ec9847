"""What a format reader returns: cameras with their calibration and frame source. No pixels, no policy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.frames import FrameSource


@dataclass(frozen=True, slots=True)
class CameraEntry:
    """One camera as its capture describes it, already checked.

    Attributes:
        name: As the capture calls it.
        K: Intrinsics in pixels at `image_size`. [3, 3] float64
        world_to_camera: Rigid map, OpenCV axes. [4, 4] float64
        image_size: Width and height of the stored frames.
        source: Where its frames come from.
    """

    name: str
    K: np.ndarray
    world_to_camera: np.ndarray
    image_size: tuple[int, int]
    source: FrameSource


@dataclass(frozen=True, slots=True)
class Layout:
    """A capture folder as read from disk.

    Attributes:
        format: Name of the reader.
        cameras: At least one; all with `n_frames` frames.
        n_frames: Frames of every camera.
        fps: Frames per second.
        default_holdout: Names of the cameras that the capture itself sets aside for evaluation. May be empty.
        warnings: Plain sentences about what was found odd but usable.
    """

    format: str
    cameras: tuple[CameraEntry, ...]
    n_frames: int
    fps: float
    default_holdout: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def rig(self) -> CameraRig:
        """The cameras at the size of the stored frames."""
        return CameraRig(
            names=tuple(camera.name for camera in self.cameras),
            world_to_camera=np.stack([camera.world_to_camera for camera in self.cameras]),
            Ks=np.stack([camera.K for camera in self.cameras]),
            image_sizes=np.array([camera.image_size for camera in self.cameras], dtype=np.int64),
        )
