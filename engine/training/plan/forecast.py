"""Forecast figures of a clip: from trained clips of the project, else from timed steps and rough sizes.

No torch, no clock, no files.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from engine.clip_files.clip_header import ClipHeader
from engine.training.preparation.picture_store import Shape, bytes_of

_START_S, _PICTURE_S = {True: 2.5, False: 3.5}, 5e-3
"""Rough preparation: of a source clip or not; of a picture that is read."""
_CAMERA_CORE_S, _DEPTHS_CORE_S = 0.9, 0.3
"""Likewise of one core: of a camera whose depths are found; of a picture whose depths start from those of the frame
before."""
_PROGRAM_MB, _CACHE_MB = 650.0, 537.0
"""Python, torch, numba and compiled kernels; decoded pictures that a capture keeps at most."""


@dataclass(frozen=True, slots=True)
class MeasuredClip:
    """A trained clip of the same project, and its costs; None where not recorded.

    Attributes:
        is_source: Whether it started from another trained clip.
        is_still: Whether nothing moved, so that it does not count for clips in which something may.
        preparation_s: Without compiling kernels.
    """

    clip_index: int
    is_source: bool
    is_still: bool
    n_steps: int
    preparation_s: float | None
    training_s: float | None
    memory_mb: float | None
    disk_mb: float | None

    @property
    def step_s(self) -> float | None:
        """Seconds of a step, with the work between steps."""
        return None if self.training_s is None or not self.n_steps else self.training_s / self.n_steps


def measured_clip(header: ClipHeader, *, disk_mb: float | None, uncounted_s: float = 0.0) -> MeasuredClip:
    """The measurements in a finished clip's file.

    Args:
        header: Of the finished clip.
        disk_mb: Its size, 10^6 bytes.
        uncounted_s: Part of its preparation that does not come again, such as compiling.
    """
    figures = header.figures
    prepared_s = _positive(figures.preparation_s)
    return MeasuredClip(
        clip_index=header.clip_index,
        is_source=header.role == "source" or header.previous_fingerprint is not None,
        is_still=header.n_alive == 0,
        n_steps=header.step,
        preparation_s=None if prepared_s is None else max(prepared_s - uncounted_s, 0.1),
        training_s=_positive(figures.training_s),
        memory_mb=_positive(figures.memory_mb),
        disk_mb=disk_mb,
    )


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0 else None


def median_of(values: Sequence[float | None]) -> float | None:
    """The middle of the known ones; None without any."""
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


def rough_preparation_s(
    *, n_cameras: int, n_pictures: int, is_source: bool, n_cores: int, is_by_frame: bool = False
) -> float:
    """Seconds before the first step, and between the phases of a reference clip, give or take half; kernels are
    compiled.

    Args:
        n_pictures: That are read, those for backgrounds included.
        n_cores: That find depths, each those of some cameras.
        is_by_frame: Whether depths are found in every picture, as with cloud=frames.
    """
    if is_by_frame:
        return _START_S[is_source] + (_DEPTHS_CORE_S / n_cores + _PICTURE_S) * n_pictures
    depths_s = 0.0 if is_source else _CAMERA_CORE_S * n_cameras / min(n_cores, n_cameras)
    return _START_S[is_source] + depths_s + _PICTURE_S * n_pictures


def rough_memory_mb(shape: Shape, *, n_read: int) -> float:
    """Most that the training process holds, 10^6 bytes: the program, the pictures, and the cache they come through.

    Args:
        shape: Of the pictures to train on.
        n_read: Pictures read at one time, backgrounds included.
    """
    _, _, height, width = shape
    return _PROGRAM_MB + bytes_of(shape)[0] / 1e6 + min(3e-6 * height * width * n_read, _CACHE_MB)
