"""Commands that exclude parts of the capture from training."""

from __future__ import annotations

from dataclasses import dataclass

from engine.capture.exclusions import Stroke


@dataclass(frozen=True, slots=True)
class ExcludeCameras:
    """Leave cameras out of training and measuring altogether, or let them take part again."""

    camera_indices: tuple[int, ...]
    is_excluded: bool = True


@dataclass(frozen=True, slots=True)
class ExcludeFrames:
    """Leave pictures out, or let them take part again.

    Attributes:
        first, stop: Frames [first, stop).
        camera_index: Of this camera; None for all of them.
    """

    first: int
    stop: int
    camera_index: int | None = None
    is_excluded: bool = True


@dataclass(frozen=True, slots=True)
class PaintMask:
    """Paint, or erase, areas that training does not look at in pictures of a camera.

    Attributes:
        first, stop: Frames [first, stop) that it is for.
    """

    camera_index: int
    first: int
    stop: int
    stroke: Stroke


@dataclass(frozen=True, slots=True)
class RemoveMasks:
    """Remove painted masks of a camera; only those that cover the frame, unless that is None."""

    camera_index: int
    frame_index: int | None = None


ExclusionCommand = ExcludeCameras | ExcludeFrames | PaintMask | RemoveMasks
"""Commands that change the exclusions, and can be taken back."""
