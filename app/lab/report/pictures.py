"""Pictures of a trained project for its report: truth and render of a frame, maps of a clip boundary."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.evaluation import boundary_maps
from app.evaluation.headless import TrainedProject

if TYPE_CHECKING:
    from engine.metrics.clips.seams import SeamMaps
    from engine.metrics.clips.trained_clip import TrainedClip


class Pictures(Protocol):
    """Where a report gets its pictures; tests bring small ones."""

    def pair(self, clip_index: int, frame_index: int, camera: str) -> tuple[np.ndarray, np.ndarray]:
        """What a camera took [H, W, 3] uint8, and the render in its colours [H, W, 3] float32."""
        ...

    def seam(self, clip_index: int, camera: str) -> SeamMaps:
        """Maps at the start of a clip."""
        ...


class ProjectPictures:
    """Renders them. Keeps one clip loaded."""

    def __init__(self, opened: TrainedProject) -> None:
        self._opened = opened
        self._clip: TrainedClip | None = None
        use_threads(None)

    def pair(self, clip_index: int, frame_index: int, camera: str) -> tuple[np.ndarray, np.ndarray]:
        """See Pictures."""
        if self._clip is None or self._clip.clip.clip_index != clip_index:
            self._clip = self._opened.load(clip_index)
        capture = self._opened.capture
        row = capture.rig.names.index(camera)
        image = self._clip.picture(capture.rig, row, self._clip.clip.clip_time(frame_index))
        return capture.frame(row, frame_index), image

    def seam(self, clip_index: int, camera: str) -> SeamMaps:
        """See Pictures."""
        camera_index = self._opened.capture.rig.names.index(camera)
        return boundary_maps(self._opened, clip_index=clip_index, camera_index=camera_index)
