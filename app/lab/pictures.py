"""Pictures of a trained project for its report: truth and render of a frame, maps of changes, space that is covered."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.evaluation import change_maps
from app.evaluation.headless import TrainedProject
from app.playback.modes.arrays import AnchorArrays
from app.playback.modes.coverage import CoverageRequest, CoveredSpace, coverage_of
from engine.clip_files.roles import ROLES

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

    def covered(self, clip_index: int) -> CoveredSpace:
        """Spheres of the reference clip's anchors, and the residual anchors of a source clip."""
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

        clip = self._loaded(clip_index)
        shown = replace(clip, model=with_features(clip.model, features))
        capture = self._opened.capture
        row = capture.rig.names.index(camera)
        image = shown.picture(capture.rig, row, shown.clip.clip_time(frame_index))
        return capture.frame(row, frame_index), image

    def changes(self, frame_index: int, camera: str) -> SeamMaps:
        """See Pictures."""
        camera_index = self._opened.capture.rig.names.index(camera)
        return change_maps(self._opened, frame_index=frame_index, camera_index=camera_index)

    def covered(self, clip_index: int) -> CoveredSpace:
        """See Pictures."""
        inherited = self._loaded(self._opened.project.settings.reference_clip).model.anchors()
        own = self._loaded(clip_index).model.anchors()
        is_residual = own.own_roles == ROLES.index("residual")  # adapted ones have spheres as they were inherited
        anchors = AnchorArrays(
            inherited.own_positions,
            own.own_positions[is_residual],
            clip_index,
            inherited_roles=inherited.own_roles,
            own_roles=own.own_roles[is_residual],
            has_changing_static=inherited.has_changing_static,
        )
        return coverage_of(CoverageRequest(clip_index, anchors))

    def _loaded(self, clip_index: int) -> TrainedClip:
        if self._clip is None or self._clip.clip.clip_index != clip_index:
            self._clip = self._opened.load(clip_index)
        return self._clip
