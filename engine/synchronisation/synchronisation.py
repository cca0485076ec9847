"""The findings about the time offsets of cameras: by which source, how certain, and where sources disagree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

SourceName = Literal["timecode", "audio", "epipolar", "motion", "creation time"]
"""timecode: written by the cameras; audio: sound tracks; epipolar: where things move, with calibration; motion: how
much moves when; creation time: when files were begun, to the second."""
IN_STEP_FRAMES = 0.25
"""Offsets up to this count as none: what is nearest to a moment stays the same frame."""
SURE_SIGMAS = 3.0
"""An offset this many times its uncertainty away from another one differs from it."""
APPLY_SIGMA = 0.35
"""Offsets are fit to be applied where they are certain to this many frames: a wrong whole frame is unlikely then."""


@dataclass(frozen=True, slots=True)
class PairOffset:
    """One measurement between two cameras.

    Attributes:
        first: Row of one camera.
        second: Row of the other.
        offset_frames: Offset of the second minus offset of the first.
        sigma_frames: How uncertain that is by itself.
    """

    first: int
    second: int
    offset_frames: float
    sigma_frames: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """The result of one source.

    Attributes:
        source: Which one.
        offsets_frames: Per camera: its own frame = common frame + offset; NaN where the source says nothing. Only
            differences between cameras of the same group count. [C] float64
        sigmas_frames: Standard deviations, NaN likewise. [C] float64
        groups: Cameras with the same number are connected by measurements; -1 where nothing is known. [C] int64
        pairs: The measurements between two cameras behind it; none for tags.
        agreements: Share of the pairs of each camera that agree with its offset, weighed by their certainty; NaN
            where there are none. [C] float64
        note: A sentence on how it was measured, or why it says nothing.
    """

    source: SourceName
    offsets_frames: np.ndarray
    sigmas_frames: np.ndarray
    groups: np.ndarray
    pairs: tuple[PairOffset, ...]
    agreements: np.ndarray
    note: str

    @property
    def n_known(self) -> int:
        """Cameras of which it says something."""
        return int((self.groups >= 0).sum())


@dataclass(frozen=True, slots=True)
class CameraOffset:
    """The offset of one camera.

    Attributes:
        name: Of the camera.
        offset_frames: Its own frame = common frame + offset. 0 where nothing is known.
        sigma_frames: Standard deviation; infinite where nothing is known.
        confidence: 0 to 1: how likely the offset is right to half a frame.
        source: Where it comes from; None where nothing is known.
    """

    name: str
    offset_frames: float
    sigma_frames: float
    confidence: float
    source: SourceName | None

    @property
    def is_in_step(self) -> bool:
        """Whether the camera needs no shift, as far as is known."""
        return self.source is not None and abs(self.offset_frames) <= IN_STEP_FRAMES

    @property
    def is_sure(self) -> bool:
        """Whether the offset is certain enough to be applied without a further look."""
        return self.source is not None and self.sigma_frames <= APPLY_SIGMA and self.confidence >= 0.8


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Two sources that say different things of one camera.

    Attributes:
        camera_index: Row of the camera.
        source: The source whose word was taken.
        other: The one that differs.
        difference_frames: Offset by `other` minus the one taken.
        text: The same as a sentence.
    """

    camera_index: int
    source: SourceName
    other: SourceName
    difference_frames: float
    text: str


@dataclass(frozen=True, eq=False)
class Synchronisation:
    """The offsets of all cameras, and everything they rest on.

    Attributes:
        cameras: One per camera, in the order they were given. Most of them have about 0: the zero is the one that most
            cameras share.
        estimates: Of every source that was asked, also those that say nothing.
        disagreements: Between sources.
        fps: Frames per second that offsets are counted in.
    """

    cameras: tuple[CameraOffset, ...]
    estimates: tuple[Estimate, ...]
    disagreements: tuple[Disagreement, ...]
    fps: float

    @property
    def offsets_frames(self) -> np.ndarray:
        """Offset of every camera. [C] float64"""
        return np.array([camera.offset_frames for camera in self.cameras])

    @property
    def is_in_step(self) -> bool:
        """Whether no camera needs a shift, as far as is known."""
        return all(camera.source is None or camera.is_in_step for camera in self.cameras)

    @property
    def is_known(self) -> bool:
        """Whether the offset of every camera is known."""
        return all(camera.source is not None for camera in self.cameras)
