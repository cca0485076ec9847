"""How each camera's exposure changes over a whole capture: a few pictures per camera, against the first of them.

For a look before training, in a bounded time; training measures every picture, see engine.cloud.background.exposure.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.capture.capture import Capture
from engine.cloud.background.exposure import at_working_size, gain_of
from engine.errors import CaptureError
from engine.parallel import map_ordered

CHANGE_LIMIT = 0.01
"""A camera changes when a channel of it leaves the range of this share between its darkest and brightest picture."""
STEP_LIMIT = 0.02
"""More than this share from one picture to the next is a step, if the rest is calm."""
_CALM_SHARE = 0.35
"""The rest is calm where no other change is larger than this share of the smallest step."""
_MAX_STEPS = 2
MAX_FRAMES, MIN_FRAMES = 12, 4
"""Pictures of a camera, and how few of many cameras."""
MAX_PICTURES = 1200
MAX_SECONDS = 20.0
"""After this long no further camera is begun, and one that is begun is given up, apart from the very first."""
_GOLDEN = 0.6180339887


@dataclass(frozen=True)
class ExposureCurve:
    """One camera's exposure.

    Attributes:
        frames: Capture frame indices, rising. [T]
        gains: Of each of them against the first. [T, 3]
    """

    frames: tuple[int, ...]
    gains: np.ndarray

    @cached_property
    def levels(self) -> np.ndarray:
        """Change of brightness against the first picture, mean of the channels; 0.01 is 1 percent brighter. [T]"""
        return np.exp(np.log(self.gains).mean(1)) - 1.0

    @property
    def has_changed(self) -> bool:
        """Whether a channel changes by more than CHANGE_LIMIT."""
        return bool((np.ptp(np.log(self.gains), axis=0) > np.log1p(CHANGE_LIMIT)).any())

    @property
    def color_shift(self) -> float:
        """By how much the ratio of two channels changes at most, as a share: the white balance."""
        logs = np.log(self.gains)
        return float(max(np.expm1(np.ptp(logs[:, i] - logs[:, j])) for i, j in ((0, 1), (0, 2), (1, 2))))

    @cached_property
    def steps(self) -> tuple[tuple[int, int, float], ...]:
        """Sudden changes: frame before, frame after, and the change as a share. None where all of it is restless."""
        logs = np.log1p(self.levels)
        changes = np.diff(logs)
        size = np.abs(changes)
        is_step = size > np.log1p(STEP_LIMIT)
        if not 0 < is_step.sum() <= _MAX_STEPS or (~is_step).sum() < 2:
            return ()
        if size[~is_step].max() > _CALM_SHARE * size[is_step].min():
            return ()
        return tuple((self.frames[i], self.frames[i + 1], float(np.expm1(changes[i]))) for i in np.flatnonzero(is_step))


@dataclass(frozen=True)
class ExposureSurvey:
    """The cameras of a capture that were looked at.

    Attributes:
        frames: Capture frame indices of all curves. [T]
        curves: By name, in the order of the rig.
        n_cameras: Of the capture.
        unreadable: Why a camera's pictures could not be read, by name.
        is_late: Whether cameras were left out because it took too long.
    """

    frames: tuple[int, ...]
    curves: dict[str, ExposureCurve]
    n_cameras: int
    unreadable: dict[str, str]
    is_late: bool = False

    @property
    def n_left_out(self) -> int:
        """Cameras that were not looked at."""
        return self.n_cameras - len(self.curves) - len(self.unreadable)


def survey_exposure(capture: Capture, *, clock: Callable[[], float] = time.monotonic) -> ExposureSurvey:
    """Look at pictures spread over the capture, of as many cameras as the time allows, spread over the rig.

    Args:
        clock: Seconds; tests bring their own.
    """
    n_cameras = len(capture.rig)
    n_frames = min(max(MAX_PICTURES // n_cameras, MIN_FRAMES), MAX_FRAMES, capture.n_frames)
    frames = tuple(sorted({round(i * (capture.n_frames - 1) / max(n_frames - 1, 1)) for i in range(n_frames)}))
    order = sorted(range(n_cameras), key=lambda camera: camera * _GOLDEN % 1.0)[: max(MAX_PICTURES // len(frames), 1)]
    deadline = clock() + MAX_SECONDS

    def look(camera: int) -> np.ndarray | str | None:
        """Gains; None where time is up; the reason where the pictures cannot be read."""
        first: np.ndarray | None = None
        gains = []
        for frame in frames:
            if camera != order[0] and clock() > deadline:
                return None
            try:
                picture = at_working_size(capture.frame(camera, frame))
            except CaptureError as error:
                return error.message
            first = picture if first is None else first
            gains.append(gain_of(picture, first))
        return np.stack(gains)

    found = dict(zip(order, map_ordered(look, order), strict=True))
    curves, unreadable = {}, {}
    for camera in sorted(found):
        result = found[camera]
        if isinstance(result, str):
            unreadable[capture.rig.names[camera]] = result
        elif result is not None:
            curves[capture.rig.names[camera]] = ExposureCurve(frames, result)
    return ExposureSurvey(frames, curves, n_cameras, unreadable, any(result is None for result in found.values()))
