"""Training pictures: the pixels of one clip's training cameras, all in the exposure of the reference clip, and without
vignetting.

Pictures stay uint8 (a clip of 27 cameras x 10 frames at 640 x 360 is 187 MB); the loss reads them like that.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.images.rendition import Rendition
from engine.parallel import map_ordered
from engine.training.preparation.picture_store import PictureStore


class TrainingPictures:
    """All pictures of a clip, camera by camera.

    Args:
        capture: Source of pixels.
        clip: Frames to load.
        camera_indices: Training cameras, in capture numbering; a row here is a position in this list.
        folder: For pictures that do not fit into memory.

    Attributes:
        is_valid: Pixels that these cameras see, in every frame; None where they see all. [C, H, W] bool
    """

    def __init__(self, capture: Capture, clip: Clip, camera_indices: Sequence[int], folder: Path) -> None:
        self.camera_indices = list(camera_indices)
        self.capture, self.clip = capture, clip
        self.is_valid = capture.valid_of(self.camera_indices)
        frames = list(clip.frame_indices())
        width, height = capture.picture_size
        self._pixels = PictureStore((len(self.camera_indices), clip.n_frames, height, width), folder)

        def read(row: int) -> None:
            self._pixels.put(row, capture.frames_of(self.camera_indices[row], frames))

        # side by side: decoders and lenses work without the interpreter
        map_ordered(read, range(len(self.camera_indices)))

    def __len__(self) -> int:
        return len(self.camera_indices) * self.clip.n_frames

    @property
    def n_cameras(self) -> int:
        """Training cameras."""
        return len(self.camera_indices)

    def valid(self, camera_row: int) -> np.ndarray | None:
        """Pixels that a camera sees; None where it sees all. [H, W] bool"""
        return self.capture.valid(self.camera_indices[camera_row])

    def valid_in(self, camera_row: int, frame_in_clip: int) -> np.ndarray | None:
        """Pixels of one picture that count; None for all. [H, W] bool"""
        return self.capture.valid_in(self.camera_indices[camera_row], self.clip.start + frame_in_clip)

    def valid_in_frame(self, frame_in_clip: int) -> np.ndarray | None:
        """`valid_in` of all cameras in one frame; None where all count. [C, H, W] bool"""
        found = [self.valid_in(row, frame_in_clip) for row in range(self.n_cameras)]
        if all(valid is None for valid in found):
            return None
        width, height = self.capture.picture_size
        return np.stack([np.ones((height, width), bool) if valid is None else valid for valid in found])

    def is_usable(self, camera_row: int, frame_in_clip: int) -> bool:
        """Whether anything of a picture is left to be trained on."""
        return self.capture.is_usable(self.camera_indices[camera_row], self.clip.start + frame_in_clip)

    def picture(self, camera_row: int, frame_in_clip: int) -> np.ndarray:
        """One picture. [H, W, 3] uint8"""
        return self._pixels.picture(camera_row, frame_in_clip)

    def of_camera(self, camera_row: int) -> np.ndarray:
        """All pictures of one camera. [M, H, W, 3] uint8"""
        return self._pixels.of_camera(camera_row)

    def remove(self, drift: np.ndarray | None, vignetting: np.ndarray | None) -> None:
        """Take out of the pictures how the cameras' exposure changes, what their lenses lose towards the rim, or both.

        Args:
            drift: Gains of the cameras against the reference clip, frame by frame. [C, M, 3]
            vignetting: Of the lenses, see engine.images.rendition. [C, 2]
        """
        rig = self.capture.rig

        def correct(row: int) -> None:
            camera = self.camera_indices[row]
            gains = np.ones((self.clip.n_frames, 3)) if drift is None else drift[row]
            lens = None if vignetting is None else vignetting[row]
            seen = [Rendition.of(gain, lens, rig.Ks[camera], rig.image_sizes[camera]) for gain in gains]
            if any(not rendition.is_plain for rendition in seen):
                pictures = self._pixels.of_camera(row)
                for frame, one in enumerate(seen):
                    pictures[frame] = one.to_scene(pictures[frame])
                self._pixels.put(row, pictures)

        map_ordered(correct, range(self._pixels.n_cameras))
