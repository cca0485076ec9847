"""SynchronisationPage: how far cameras are ahead of each other, as the window shows it. Values only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, slots=True)
class OffsetRow:
    """Result of one camera.

    Attributes:
        name: Of the camera.
        offset_frames: Its own frame = common frame + this; None where nothing is known.
        sigma_frames: How uncertain that is.
        confidence: 0 to 1: how likely it is right to half a frame.
        source: Of the measurement; empty where nothing is known.
        is_sure: Whether it is certain enough to be applied without a further look.
    """

    name: str
    offset_frames: float | None
    sigma_frames: float
    confidence: float
    source: str
    is_sure: bool


@dataclass(frozen=True, slots=True)
class SynchronisationPage:
    """Contents of the dialog.

    Attributes:
        capture: Its folder.
        state: "running", "done", or "written".
        rows: In the order of the rig; none before it was measured.
        notes: How each source was measured, or why it gives no result.
        disagreements: Where sources differ.
        is_in_step: Whether no camera needs a shift, as far as is known.
        fps: Frames per second.
        failure: Why it could not be measured or written; empty where it could.
        target: Where a corrected capture goes unless another folder is named: the capture itself, or another folder
            where something was trained on it as it is.
        written: The folder that the corrected capture is in; None before.
    """

    capture: Path
    state: Literal["running", "done", "written"] = "running"
    rows: tuple[OffsetRow, ...] = ()
    notes: tuple[str, ...] = ()
    disagreements: tuple[str, ...] = ()
    is_in_step: bool = False
    fps: float = 30.0
    failure: str = ""
    target: Path = Path()
    written: Path | None = None

    @property
    def can_apply(self) -> bool:
        """Whether there is something to correct, and it is certain enough."""
        return bool(self.rows) and not self.is_in_step and all(row.is_sure for row in self.rows if row.source)

    @property
    def text(self) -> str:
        """All of it, to be copied."""
        lines = [
            f"{row.name}: unknown"
            if row.offset_frames is None
            else f"{row.name}: {row.offset_frames:+.2f} frames ± {row.sigma_frames:.2f}, by {row.source}"
            for row in self.rows
        ]
        return "\n".join([*lines, *self.notes, *self.disagreements])
