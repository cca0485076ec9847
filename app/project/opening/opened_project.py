"""OpenedProject: a capture and its project as one value, which everything that shows or trains them is handed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.project.project import Project
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.capture.clip import Clip


@dataclass(frozen=True, slots=True)
class OpenedProject:
    """The open project. Other settings make another value of the same generation, another project one of the next.

    Attributes:
        clips: Of the capture, as the project's settings divide it.
        holdout: Camera indices that training never sees.
        generation: Goes up with every project that is opened. Part of every key by which results are kept, so that
            nothing of a project that was left is taken for one of the next.
    """

    capture: Capture
    project: Project
    clips: tuple[Clip, ...]
    holdout: tuple[int, ...]
    generation: int

    @property
    def rig(self) -> CameraRig:
        """Cameras of the capture."""
        return self.capture.rig

    @property
    def reference_index(self) -> int:
        """The clip that the others inherit from."""
        return self.project.settings.reference_clip

    def inherited_path(self, clip_index: int) -> Path | None:
        """The finished clip that this one inherits from; None where it inherits nothing."""
        base = self.project.inherited_index(clip_index)
        return None if base is None else self.project.clip_path(base)


def opened_project(capture: Capture, project: Project, generation: int) -> OpenedProject:
    """A capture and its project, with the settings that it has now."""
    known = [name for name in project.settings.holdout if name in capture.rig.names]
    clips = tuple(project.clips(capture.n_frames))
    return OpenedProject(capture, project, clips, tuple(capture.camera_indices(known)), generation)
