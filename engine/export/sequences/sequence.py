"""A sequence of splats over time: what a file over time is written from, and what its reader gives."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from engine.export.splats import Splats


@dataclass(frozen=True, slots=True)
class MovingSplats:
    """What moves, at one frame.

    Attributes:
        splats: The Gaussians. N of them.
        ids: The same Gaussian has the same number at each frame of a stretch where it exists. [N] int64, no two equal
    """

    splats: Splats
    ids: np.ndarray


@dataclass(frozen=True, slots=True)
class SequenceStretch:
    """Consecutive frames that share what stands still, normally those of a clip.

    Attributes:
        first_frame: Of the file, counted from 0.
        n_frames: At least one.
        still: What is the same at all of these frames.
        moving: The rest of a frame of the file.
    """

    first_frame: int
    n_frames: int
    still: Splats
    moving: Callable[[int], MovingSplats]


@dataclass(frozen=True, slots=True)
class SequenceSound:
    """The sound of a file over time: a WAV file that starts with the first frame.

    Attributes:
        n_bytes: Of all of it.
        pieces: Makes it anew, piece by piece, so that memory never holds more than one.
    """

    n_bytes: int
    pieces: Callable[[], Iterable[bytes]] = field(compare=False)


@dataclass(frozen=True, slots=True)
class SequenceTiming:
    """When the frames of a file are shown, and how large its scene is.

    Attributes:
        n_frames: Of the file, at least one.
        fps: Frames per second.
        sound: None without sound.
        meters_per_unit: Length of a unit of the file, m; None where that is not known, or not read.
    """

    n_frames: int
    fps: float
    sound: SequenceSound | None = None
    meters_per_unit: float | None = None


class SequenceReader(Protocol):
    """An opened file over time. Frames may be read in any order; memory stays bounded."""

    @property
    def timing(self) -> SequenceTiming:
        """When its frames are shown."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not kept, as sentences for the user."""
        ...

    def splats(self, frame: int) -> Splats:
        """All Gaussians of a frame of the file, and which way is up. Raises ProjectError where it is damaged there."""
        ...

    def close(self) -> None:
        """Let go of the file."""
        ...
