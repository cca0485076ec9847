"""MendRequest: what is to be mended, as it crosses to the process that does it; and what that gives back."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from app.project.mends.record import MendRecord
from engine.backends.table import chosen_name
from engine.capture.clip import Clip
from engine.errors import ProjectError
from engine.mending.figures import CHOICES
from engine.mending.stretch import Stretch, boundary_stretch, frames_stretch


class MendRequest(msgspec.Struct, frozen=True):
    """What is to be mended: a boundary, or a stretch of frames.

    Attributes:
        after: The clip that begins at the boundary; None for frames.
        frames: First frame and the one behind the last; None for a boundary.
        method: One of engine.mending.figures.METHODS, or "auto".
    """

    after: int | None = None
    frames: tuple[int, int] | None = None
    method: str = "auto"

    def stretch(self, clips: Sequence[Clip]) -> Stretch:
        """The frames it is about.

        Raises:
            ProjectError: There are no such frames, or there is no such boundary or method.
        """
        if self.method not in CHOICES or self.method == "retrain":
            raise ProjectError(f"{self.method!r} is not a mending method.")
        if self.after is not None:
            return boundary_stretch(clips, self.after)
        if self.frames is None:
            raise ProjectError("No frames to mend were named.", hint="Name a boundary or frames.")
        return frames_stretch(clips, *self.frames)


class MendJob(msgspec.Struct, frozen=True):
    """What the process is told.

    Attributes:
        project: Its folder.
        request: What is to be mended.
        folder: Where drafts of clips go, on the disk of the project.
        n_threads: What to compute with; None for all cores.
        is_window_open: Leave the right of way to a window.
        backend: Name of what is computed with.
    """

    project: str
    request: MendRequest
    folder: str
    n_threads: int | None = None
    is_window_open: bool = False
    backend: str = msgspec.field(default_factory=chosen_name)


class MendResult(msgspec.Struct, frozen=True):
    """What the process leaves.

    Attributes:
        record: The result.
        drafts: Files of the clips that changed, by index.
    """

    record: MendRecord
    drafts: dict[int, str] = {}
