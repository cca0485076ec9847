"""MendRequest: a boundary or frames to mend, as sent to the process that does it; and that process's result."""

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
    """A boundary or a stretch of frames to mend.

    Attributes:
        after: The clip that begins at the boundary; None for frames.
        frames: First frame and the one after the last; None for a boundary.
        method: One of engine.mending.figures.METHODS, or "auto".
    """

    after: int | None = None
    frames: tuple[int, int] | None = None
    method: str = "auto"

    def stretch(self, clips: Sequence[Clip]) -> Stretch:
        """The frames to mend.

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
    """The job of the process.

    Attributes:
        project: Its folder.
        request: The boundary or frames to mend.
        folder: Where drafts of clips go, on the disk of the project.
        n_threads: Threads to compute with; None for all cores.
        is_window_open: Leave the right of way to a window.
        backend: Name of the back end.
    """

    project: str
    request: MendRequest
    folder: str
    n_threads: int | None = None
    is_window_open: bool = False
    backend: str = msgspec.field(default_factory=chosen_name)


class MendResult(msgspec.Struct, frozen=True):
    """The result of the process.

    Attributes:
        record: The result.
        drafts: Files of the clips that changed, by index.
    """

    record: MendRecord
    drafts: dict[int, str] = {}
