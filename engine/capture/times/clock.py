"""The common clock of a capture: which frame of each camera belongs to each moment, and how far it is from it.

Cameras may record at different rates, unevenly, start and stop at different times and be ahead of each other by parts
of a frame. Pictures are never mixed: each moment of the clock takes the nearest frame of every camera, and says by how
much it misses. The moments follow the recordings: where all cameras slow down together, so does the clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.frames import FrameSource, IndexedFrames
from engine.capture.layout.limits import FPS_RANGE
from engine.errors import CaptureError
from engine.text import rate_text

RATE_TOLERANCE = 0.02
"""Share by which the rates of two cameras may differ and still count as the same: 29.97 and 30 do, 25 and 30 do not."""
EVEN_TOLERANCE = 0.25
"""Share of a period by which a moment may lie off an even spacing before the clock is called uneven."""


@dataclass(frozen=True, eq=False)
class Clock:
    """Moments that all cameras show, and the frames nearest to them.

    Attributes:
        times_s: Moments in common time, rising. [T] float64
        frame_indices: Frame of each camera nearest to each moment, an index into its own recording. [C, T] int64
        errors_s: Seconds between that frame and the moment. [C, T] float64, not negative
        fps: Moments per second, on average.
        n_recorded: Frames that each camera recorded. [C] int64
    """

    times_s: np.ndarray
    frame_indices: np.ndarray
    errors_s: np.ndarray
    fps: float
    n_recorded: np.ndarray

    @property
    def n_frames(self) -> int:
        """Moments, which are the frames of the capture."""
        return len(self.times_s)

    @property
    def is_as_recorded(self) -> bool:
        """Whether every camera gives all its frames, one by one, so that nothing is resampled."""
        return bool((self.n_recorded == self.n_frames).all()) and bool(
            (self.frame_indices == np.arange(self.n_frames)).all()
        )

    @property
    def is_even(self) -> bool:
        """Whether the moments have the same distance from each other."""
        even = self.times_s[0] + np.arange(self.n_frames) / self.fps
        return bool(np.abs(self.times_s - even).max() < EVEN_TOLERANCE / self.fps)

    def note(self) -> str:
        """One or two sentences that say what was made of the recordings, and how well they meet."""
        spread = f"{_seconds_text(self.errors_s.mean())} on average and {_seconds_text(self.errors_s.max())} at worst"
        if self.is_as_recorded:
            return f"Frames are paired by index; cameras are apart by {spread}."
        n_least, n_most = int(self.n_recorded.min()), int(self.n_recorded.max())
        recorded = f"{n_least}" if n_least == n_most else f"{n_least} to {n_most}"
        spacing = "" if self.is_even else ", unevenly spaced,"
        text = (
            f"Of {recorded} recorded frames per camera, {self.n_frames} moments at {rate_text(self.fps)} per "
            f"second{spacing} are common to all cameras; the nearest frame of each is used, off by {spread}."
        )
        n_repeated = int((np.diff(self.frame_indices, axis=1) == 0).sum())
        if n_repeated:
            text += f" {n_repeated} times a camera has no frame of its own for a moment and repeats the previous one."
        return text

    def source(self, camera_index: int, source: FrameSource) -> FrameSource:
        """The frames of one camera by moments of the clock; `source` itself where that changes nothing."""
        frame_indices = self.frame_indices[camera_index]
        if source.n_frames == self.n_frames and (frame_indices == np.arange(self.n_frames)).all():
            return source
        return IndexedFrames(source, frame_indices)


def common_clock(
    frame_times_s: Sequence[np.ndarray],
    *,
    fps: float | None = None,
    offsets_s: Sequence[float] | None = None,
    names: Sequence[str] | None = None,
) -> Clock:
    """The moments that all cameras show, at the rate of the slowest camera.

    Args:
        frame_times_s: When each frame of each camera is shown, or was taken, in seconds of that camera; rising. C
            arrays [T_c].
        fps: Moments per second, evenly spaced; where it is the rate of the slowest camera, or None, moments are those
            of a camera.
        offsets_s: How far the time of each camera is ahead: its time = common time + offset. None: all by nothing.
        names: The cameras' names in messages.
    Raises:
        CaptureError: Times are missing, not numbers or not rising, or there is no moment that all cameras show.
    """
    names = [f"number {row}" for row in range(len(frame_times_s))] if names is None else names
    if fps is not None and not FPS_RANGE[0] <= fps <= FPS_RANGE[1]:
        raise CaptureError(f"The common clock cannot have {fps:g} frames per second.", hint="Correct fps.")
    offsets = np.zeros(len(frame_times_s)) if offsets_s is None else np.asarray(offsets_s, dtype=np.float64)
    times = [
        _checked(times_s, name) - offset for times_s, name, offset in zip(frame_times_s, names, offsets, strict=True)
    ]
    rates = [_rate(times_s) for times_s in times]
    known = [rate for rate in rates if rate > 0]
    slowest = min(known) if known else (fps or 1.0)  # single frames have no rate
    half_period = 0.5 / (fps or slowest)
    first, last = max(times_s[0] for times_s in times), min(times_s[-1] for times_s in times)
    if last < first - half_period:
        late = names[int(np.argmax([times_s[0] for times_s in times]))]
        early = names[int(np.argmin([times_s[-1] for times_s in times]))]
        raise CaptureError(
            f'No moment is common to all cameras: camera "{late}" starts {_seconds_text(first - last)} after '
            f'camera "{early}" has ended.',
            hint="Correct the time offsets, or remove one of these cameras.",
        )
    if fps is not None and abs(fps / slowest - 1) > RATE_TOLERANCE:
        moments = first + np.arange(np.floor((last - first) * fps + 0.5 + 1e-6)) / fps
        moments = moments if len(moments) else np.array([first])
    else:
        moments = _moments_of_a_camera(times, rates, slowest, first - half_period, last + half_period)
    frame_indices = np.stack([_nearest(times_s, moments) for times_s in times])
    errors_s = np.stack([np.abs(t[index] - moments) for t, index in zip(times, frame_indices, strict=True)])
    rate = (len(moments) - 1) / (moments[-1] - moments[0]) if len(moments) > 1 else (fps or slowest)
    n_recorded = np.array([len(times_s) for times_s in times], dtype=np.int64)
    return Clock(moments, frame_indices, errors_s, _tidy(float(rate), fps), n_recorded)


def _moments_of_a_camera(
    times: list[np.ndarray], rates: list[float], slowest: float, first: float, last: float
) -> np.ndarray:
    """Moments between first and last at which one of the slowest cameras has a frame: of the camera that has most of
    them, and of several such the one that the others meet best; brought into the middle of what slow cameras show."""
    slow = [times_s for times_s, rate in zip(times, rates, strict=True) if rate <= slowest * (1 + RATE_TOLERANCE)]
    candidates = []
    for camera_index, times_s in enumerate(slow):
        moments = times_s[(times_s >= first - 1e-9) & (times_s <= last + 1e-9)]
        if len(moments):
            missed = sum(float(np.abs(other[_nearest(other, moments)] - moments).mean()) for other in times)
            candidates.append((-len(moments), missed, camera_index, moments))
    if not candidates:  # the slowest camera has its frames outside the short time that all cameras share
        return np.array([(first + last) / 2])
    moments = min(candidates, key=lambda candidate: candidate[:3])[3]
    taken = np.stack([times_s[_nearest(times_s, moments)] for times_s in slow])  # [S, T]
    is_lost = np.abs(taken - moments) > 0.5 / slowest  # a camera without a frame then does not say when it was
    middle = np.median(np.where(is_lost, moments, taken), axis=0)
    is_rising = len(middle) < 2 or bool((np.diff(middle) > 0).all())
    return middle if is_rising else moments


def _nearest(times_s: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Index of the entry of rising `times_s` nearest to each moment; the earlier of two. [T] int64"""
    after = np.searchsorted(times_s, moments).clip(1, max(len(times_s) - 1, 1))
    if len(times_s) == 1:
        return np.zeros(len(moments), dtype=np.int64)
    is_before_nearer = moments - times_s[after - 1] <= times_s[after] - moments
    return np.where(is_before_nearer, after - 1, after).astype(np.int64)


def _rate(times_s: np.ndarray) -> float:
    """Frames per second of one recording by its usual distance between frames, as gaps do not count. 0: unknown."""
    if len(times_s) < 2:
        return 0.0
    usual = 1 / float(np.median(np.diff(times_s)))
    overall = (len(times_s) - 1) / float(times_s[-1] - times_s[0])
    return overall if abs(overall / usual - 1) < RATE_TOLERANCE else usual  # the longer look is the more exact one


def _tidy(rate: float, fps: float | None) -> float:
    """The rate without the dust of times that are rounded to milliseconds."""
    for tidy in (fps, round(rate), round(rate * 1.001) / 1.001):
        if tidy and abs(rate / tidy - 1) < 1e-4:
            return float(tidy)
    return rate


def _checked(times_s: np.ndarray, name: str) -> np.ndarray:
    times_s = np.asarray(times_s, dtype=np.float64)
    hint = "Correct its times, or leave them out."
    if times_s.ndim != 1 or len(times_s) == 0:
        raise CaptureError(f'Camera "{name}" has no times of its frames.', hint=hint)
    if not np.isfinite(times_s).all():
        raise CaptureError(
            f'The time of frame {int(np.argmin(np.isfinite(times_s)))} of camera "{name}" is not a number.', hint=hint
        )
    if (np.diff(times_s) <= 0).any():
        row = int(np.argmax(np.diff(times_s) <= 0)) + 1
        raise CaptureError(f'Frame {row} of camera "{name}" is not later than the frame before it.', hint=hint)
    return times_s


def _seconds_text(seconds: float) -> str:
    return f"{seconds * 1000:.1f} ms" if seconds < 1 else f"{seconds:.3g} s"
