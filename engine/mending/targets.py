"""The target look of a clip's frames: still parts pass evenly from the look of one neighbour into
that of the other.

Where nothing moves between the frame before the span that may change and a frame inside it, that frame should look as
the one before does; likewise with the frame behind the span. Where both hold, the way from one to the other is linear,
so that a jump between two neighbouring frames becomes as many small steps as there are frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from engine.byte_cache import ByteCache
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.images.rendition import Rendition
from engine.metrics.clips.seams import change_of, stands_still
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import render_model
from engine.model.host_array import host_array
from engine.training.preparation.training_pictures import TrainingPictures

MAX_BYTES = 256 << 20
"""Memory for pictures of clips as they were. They are drawn again where it does not suffice."""


class Looks:
    """The training cameras' pictures of clips as they were before, in the exposure of the reference clip.

    Args:
        capture: With all cameras.
        clips: By index; their models must no longer change.
        camera_indices: Training cameras; a row is a position in this list.
    """

    def __init__(self, capture: Capture, clips: Mapping[int, TrainedClip], camera_indices: Sequence[int]) -> None:
        self._capture, self._clips, self._cameras = capture, dict(clips), list(camera_indices)
        self._kept: ByteCache[tuple[int, int], np.ndarray] = ByteCache(MAX_BYTES)

    def clip_of(self, frame: int) -> TrainedClip | None:
        """The clip that holds a frame of the capture; None where it is not among them."""
        return next((one for one in self._clips.values() if one.clip.start <= frame < one.clip.stop), None)

    def look(self, row: int, frame: int) -> np.ndarray | None:
        """One picture; None where no clip holds the frame. [H, W, 3] float32"""
        trained = self.clip_of(frame)
        if trained is None:
            return None
        found = self._kept.get((row, frame))
        if found is None:
            camera, rig = self._cameras[row], self._capture.rig
            clip_time = trained.clip.clip_time(frame)
            image = render_model(trained.model, trained.view(rig, camera), clip_time, reach=trained.reach)
            found = host_array(image) * trained.colors.gain(rig.names[camera])
            self._kept.put((row, frame), found, found.nbytes)
        return found

    def truth(self, row: int, frame: int) -> np.ndarray:
        """The camera's own picture, in 0..1, the same exposure and without vignetting. [H, W, 3] float32"""
        pixels, trained = self._capture.frame(self._cameras[row], frame), self.clip_of(frame)
        if trained is not None:
            rig, camera, lenses = self._capture.rig, self._cameras[row], trained.base.vignetting
            gain = np.ones(3) if trained.drift is None else trained.drift[row, frame - trained.clip.start]
            lens = None if lenses is None else lenses[row]
            pixels = Rendition.of(gain, lens, rig.Ks[camera], rig.image_sizes[camera]).to_scene(pixels)
        return pixels.astype(np.float32) / np.float32(255.0)

    def still_between(self, row: int, first: int, last: int) -> np.ndarray:
        """Pixels in which nothing moves from one frame to another, in steps or slowly. [H, W] bool"""
        earlier = start = self.truth(row, first)
        is_still = np.ones(start.shape[:2], bool)
        for frame in range(first + 1, last + 1):
            later = self.truth(row, frame)
            is_still &= stands_still(change_of(later, earlier)) & stands_still(change_of(later, start) / 2)
            earlier = later
        return is_still

    def errors_across(self, frame: int) -> tuple[float, float]:
        """How far still parts are from the truth on both sides of a frame: before it, and in it. Mean squares."""
        errors = []
        for row in range(len(self._cameras)):
            is_still = self.still_between(row, frame - 1, frame)
            looks = [self.look(row, at) for at in (frame - 1, frame)]
            if looks[0] is None or looks[1] is None or not is_still.any():
                continue
            truths = [self.truth(row, at) for at in (frame - 1, frame)]
            errors.append([np.square(a - b)[is_still].mean() for a, b in zip(looks, truths, strict=True)])
        before, after = np.mean(errors, axis=0) if errors else (0.0, 0.0)
        return float(before), float(after)


class FadedPictures(TrainingPictures):
    """Pictures of one clip that a training compares with: see the top of this file.

    Args:
        capture: At working size.
        clip: Whose pictures.
        camera_indices: Training cameras.
        folder: For pictures that do not fit into memory.
        looks: Clips as they were, this one and its neighbours.
        span: Frames of the capture that may change, in this clip and a neighbour perhaps.
        is_learning: Whether what cannot be taken from the neighbours is learned from the truth; otherwise it keeps the
            look that the clip has.
    """

    def __init__(
        self,
        capture: Capture,
        clip: Clip,
        camera_indices: Sequence[int],
        folder: Path,
        looks: Looks,
        span: range,
        *,
        is_learning: bool = False,
    ) -> None:
        super().__init__(capture, clip, camera_indices, folder)
        self._looks, self._span, self._is_learning = looks, span, is_learning
        self._kept: ByteCache[tuple[int, int], np.ndarray] = ByteCache(MAX_BYTES)

    def picture(self, camera_row: int, frame_in_clip: int) -> np.ndarray:
        """The target picture of this frame, in 0..1. [H, W, 3] float32"""
        frame = self.clip.start + frame_in_clip
        found = self._kept.get((camera_row, frame))
        if found is None:
            found = np.clip(self._made(camera_row, frame), 0.0, 1.0)
            self._kept.put((camera_row, frame), found, found.nbytes)
        return found

    def _made(self, row: int, frame: int) -> np.ndarray:
        own = self._looks.truth(row, frame) if self._is_learning else self._looks.look(row, frame)
        assert own is not None
        if frame not in self._span:
            return own
        before, behind = self._span.start - 1, self._span.stop
        sums, weights = np.zeros_like(own), np.zeros(own.shape[:2], np.float32)
        for end, distance in ((before, frame - before), (behind, behind - frame)):
            look = self._looks.look(row, end)
            if look is not None:
                is_still = self._looks.still_between(row, min(end, frame), max(end, frame))
                weight = np.where(is_still, np.float32(1.0 / distance), np.float32(0.0))
                sums += weight[..., None] * look
                weights += weight
        return np.where(weights[..., None] > 0, sums / np.maximum(weights, np.float32(1e-6))[..., None], own)
