"""The result of a format reader: cameras with their calibration and frame source. No pixels, no policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine.camera.lens import PINHOLE, Lens
from engine.camera.rig import CameraRig
from engine.capture.frames import FrameSource
from engine.capture.pixels.frame_fit import FrameFit, OtherSize
from engine.capture.pixels.transfer_curves import CurveName
from engine.capture.pixels.undistortion import undistorted_K


@dataclass(frozen=True, slots=True)
class Probe:
    """A reader's first look at a folder.

    Attributes:
        is_match: Whether `read` is worth calling.
        seen: The part of the layout that is there, as "poses_bounds.npy"; empty where nothing of it was recognised.
        lacks: Why that is not enough, as a part of a sentence: "no cameras.json".
        hint: The remedy; empty where nothing was recognised.
    """

    is_match: bool
    seen: str = ""
    lacks: str = ""
    hint: str = ""


MATCH = Probe(True)


@dataclass(frozen=True, slots=True)
class CameraEntry:
    """One camera as its capture describes it, already checked.

    Attributes:
        name: As the capture calls it.
        K: Intrinsics in pixels at `image_size`, pixel centres at +0.5. [3, 3] float64
        world_to_camera: Rigid map, OpenCV axes. [4, 4] float64
        image_size: Width and height of the stored frames.
        source: Where its frames come from.
        lens: How its lens bends rays.
        masks: Where masks of what moves come from, one per frame, bright where something moves; None without.
        color_matrix: Applied to display-encoded RGB, new = matrix @ old; None leaves colours as they are. [3, 3]
        calibrated: The original K and size, where the calibration is for another size; None where it is for this one.
    """

    name: str
    K: np.ndarray
    world_to_camera: np.ndarray
    image_size: tuple[int, int]
    source: FrameSource
    lens: Lens = PINHOLE
    masks: FrameSource | None = None
    color_matrix: np.ndarray | None = None
    calibrated: OtherSize | None = None

    @property
    def misfit_px(self) -> float:
        """By how many pixels the shape of the frames differs from the calibrated one; 0 for copies of another size."""
        return 0.0 if self.calibrated is None else max(self.calibrated.cut_px(self.image_size))


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
        points: File with a point cloud that came along; None without.
        points_to_world: Brings its points into the world of the cameras; None where they are in it. [4, 4]
        fisheye_fov_deg: Horizontal view that fisheye pictures are brought to; None takes the usual one.
        fit: The user's fit for frames of another shape than their calibration; None where that is not known.
        curve: Transfer curve of all frames, which their sources undo; None keeps values as they are.
        is_growing: It may still be recorded: `n_frames` are those of the farthest camera, and others may lack some.
        has_pictures: Whether its cameras took pictures; those of an imported scene are views only.
    """

    format: str
    cameras: tuple[CameraEntry, ...]
    n_frames: int
    fps: float
    default_holdout: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    points: Path | None = None
    points_to_world: np.ndarray | None = None
    fisheye_fov_deg: float | None = None
    fit: FrameFit | None = None
    curve: CurveName | None = None
    is_growing: bool = False
    has_pictures: bool = True

    @property
    def misfit_px(self) -> float:
        """Of the camera whose frames fit their calibration worst; see `CameraEntry.misfit_px`."""
        return max(entry.misfit_px for entry in self.cameras)

    @property
    def far_off(self) -> tuple[CameraEntry, ...]:
        """Cameras that cannot be used before somebody says what became of their frames; see `OtherSize.is_far_off`."""
        if self.fit is not None:
            return ()
        return tuple(
            entry for entry in self.cameras if entry.calibrated and entry.calibrated.is_far_off(entry.image_size)
        )

    def rig(self) -> CameraRig:
        """The pinhole cameras that the stored frames are brought to, at the size of the stored frames."""
        Ks = [undistorted_K(entry.K, entry.lens, entry.image_size, self.fisheye_fov_deg) for entry in self.cameras]
        return CameraRig(
            names=tuple(camera.name for camera in self.cameras),
            world_to_camera=np.stack([camera.world_to_camera for camera in self.cameras]),
            Ks=np.stack(Ks),
            image_sizes=np.array([camera.image_size for camera in self.cameras], dtype=np.int64),
        )
