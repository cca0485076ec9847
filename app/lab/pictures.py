"""Pictures of a trained project for its report: truth and render of a frame, maps of changes between frames."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.evaluation import change_maps
from app.evaluation.headless import TrainedProject

if TYPE_CHECKING:
    from engine.metrics.clips.features_apart import Features
    from engine.metrics.clips.seams import SeamMaps
    from engine.metrics.clips.trained_clip import TrainedClip


class Pictures(Protocol):
    """Source of a report's pictures; tests bring small ones."""

    def pair(
        self, clip_index: int, frame_index: int, camera: str, features: Features = "both"
    ) -> tuple[np.ndarray, np.ndarray]:
        """A camera's picture [H, W, 3] uint8, and the render in its colours [H, W, 3] float32.

        Args:
            features: Which features of the anchors are used, see engine.metrics.clips.features_apart.
        """
        ...

    def changes(self, frame_index: int, camera: str) -> SeamMaps:
        """Maps from the frame before to a frame."""
        ...


class RenderedPictures:
    """Renders them. Keeps one clip loaded."""

    def __init__(self, opened: TrainedProject) -> None:
        self._opened = opened
        self._clip: TrainedClip | None = None
        use_threads(None)

    def pair(
        self, clip_index: int, frame_index: int, camera: str, features: Features = "both"
    ) -> tuple[np.ndarray, np.ndarray]:
        """See Pictures."""
        from engine.metrics.clips.features_apart import with_features

        if self._clip is None or self._clip.clip.clip_index != clip_index:
            self._clip = self._opened.load(clip_index)
        shown = replace(self._clip, model=with_features(self._clip.model, features))
        capture = self._opened.capture
        row = capture.rig.names.index(camera)
        image = shown.picture(capture.rig, row, shown.clip.clip_time(frame_index))
        return capture.frame(row, frame_index), image

    def changes(self, frame_index: int, camera: str) -> SeamMaps:
        """See Pictures."""
        camera_index = self._opened.capture.rig.names.index(camera)
        return change_maps(self._opened, frame_index=frame_index, camera_index=camera_index)
