"""Training pictures: the pixels of one clip's training cameras, and the order in which they are drawn.

Pictures stay uint8 in memory (a clip of 27 cameras x 10 frames at 640 x 360 is 187 MB); the loss reads them like that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import PreparationError


def shared_image_size(capture: Capture) -> tuple[int, int]:
    """Width and height of all cameras.

    Raises:
        PreparationError: Cameras differ in size; training needs one size.
    """
    sizes = {(int(w), int(h)) for w, h in capture.rig.image_sizes}
    if len(sizes) != 1:
        listed = ", ".join(f"{w}x{h}" for w, h in sorted(sizes))
        raise PreparationError(
            f"Cameras have different picture sizes ({listed}); training needs one size.",
            hint="Resize the videos and their calibration to one size.",
            path=capture.path,
        )
    return sizes.pop()


class TrainingPictures:
    """All pictures of a clip, camera by camera.

    Args:
        capture: Source of pixels.
        clip: Frames to load.
        camera_indices: Training cameras, in capture numbering; a row here is a position in this list.
    """

    def __init__(self, capture: Capture, clip: Clip, camera_indices: Sequence[int]) -> None:
        self.camera_indices = list(camera_indices)
        self.clip = clip
        frames = list(clip.frame_indices())
        self._pixels = [capture.frames_of(camera, frames) for camera in self.camera_indices]

    def __len__(self) -> int:
        return len(self.camera_indices) * self.clip.n_frames

    def raw(self, camera_row: int, frame_in_clip: int) -> np.ndarray:
        """One picture as decoded. [H, W, 3] uint8"""
        return self._pixels[camera_row][frame_in_clip]


class ShuffledOrder:
    """Draws items of range(n) without replacement, reshuffled after each pass. Owns its random state."""

    def __init__(self, n_items: int, seed: int) -> None:
        self.n_items = n_items
        self._generator = np.random.default_rng(seed)
        self._left: list[int] = []

    def draw(self) -> int:
        """The next item."""
        if not self._left:
            self._left = self._generator.permutation(self.n_items).tolist()
        return self._left.pop()

    def state(self) -> dict:
        """JSON-able state, to go on exactly here."""
        return {
            "left": list(self._left),
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict) -> None:
        """Inverse of `state`."""
        self._left = list(state["left"])
        self._generator.bit_generator.state = state["generator"]
