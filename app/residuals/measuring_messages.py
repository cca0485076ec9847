"""Messages between the window's process and the one that measures: small typed values."""

from __future__ import annotations

import msgspec
import numpy as np

from app.residuals.figures import PairFigures, RowFigures
from app.residuals.measuring_order import MeasuringFocus
from engine.backends.table import chosen_name


class MeasureJob(msgspec.Struct, frozen=True, eq=False):
    """Everything that the process is started with.

    Attributes:
        project: Folder.
        capture, scale, frames, follow_links: How its capture is opened; the project may still name another place.
        trained: Clips that can be measured.
        rows, pairs: Missing figures, by frame and camera; pairs by the later frame. [F, C] bool
        is_kept: Whether figures are written into the project.
        look: The clip and camera that the user looks at.
        share: Of the time that may be computed, see SetShare.
        backend: Name of the back end.
    """

    project: str
    capture: str
    scale: float
    frames: tuple[int, int] | None
    follow_links: bool
    trained: tuple[int, ...]
    rows: np.ndarray
    pairs: np.ndarray
    is_kept: bool
    look: MeasuringFocus
    share: float = 1.0
    backend: str = msgspec.field(default_factory=chosen_name)


class LookAt(msgspec.Struct, frozen=True, tag=True):
    """The user looks at something else."""

    look: MeasuringFocus


class SetShare(msgspec.Struct, frozen=True, tag=True):
    """From now on compute for at most this share of one core's time, in (0, 1]."""

    share: float


class PictureMeasured(msgspec.Struct, frozen=True, tag=True):
    """A picture, or two neighbouring frames."""

    clip_index: int
    row: RowFigures | None = None
    pair: PairFigures | None = None


class Trouble(msgspec.Struct, frozen=True, tag=True):
    """Something could not be read or kept; the rest continues."""

    message: str


class MeasuringEnded(msgspec.Struct, frozen=True, tag=True):
    """Nothing is left to measure, or the process has ended. Made by MeasuringProcess, never sent."""


Command = LookAt | SetShare
Event = PictureMeasured | Trouble | MeasuringEnded
