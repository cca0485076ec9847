"""The pictures for the checks: those of every camera, decoded once in order of time, made small where that will do."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.cameras.camera_optics import resize_area
from engine.capture.capture import Capture
from engine.cloud.background.exposure import at_working_size, gain_of
from engine.cloud.background.exposure_survey import ExposureCurve, ExposureSurvey
from engine.errors import CaptureError
from engine.parallel import map_ordered
from engine.progress import Progress, ReportProgress

MAX_PICTURES = 1400
"""Of the whole capture, so that a long one takes no longer than a short one."""
MIN_FRAMES = 16
"""Of each camera, however many cameras there are."""
RUN_LENGTH = 8
"""Frames in a row: what repeats is seen only where none is left out."""
N_SPREAD = 12
"""Pictures over the whole length, for exposure and for still parts."""
BACKGROUND_ROWS = (0, 3, 6, 8, 11)
"""Of these the background is the median."""
STEADY_WIDTH_PX = 320
"""Of the pictures in which a moving camera is looked for."""
MATCH_WIDTH_PX = 1280
"""Backgrounds get at most about so wide."""
STAGE = "Looking at pictures"


@dataclass(frozen=True, eq=False)
class CameraLook:
    """One camera.

    Attributes:
        gray: Small grey pictures of `Look.frames`. [T, h, w] uint8
        steady: Grey pictures of `Look.spread`, at most about STEADY_WIDTH_PX wide. [S, h, w] uint8
        gains: Exposure of `Look.spread` against the first. [S, 3]
        background: Median over time. [H, W, 3] uint8
    """

    gray: np.ndarray
    steady: np.ndarray
    gains: np.ndarray
    background: np.ndarray


@dataclass(frozen=True, eq=False)
class PictureSurvey:
    """The survey's pictures.

    Attributes:
        capture: The capture.
        frames: Capture frame indices of which every camera's picture was looked at, rising; in runs.
        spread: Of these, N_SPREAD or fewer over the whole length.
        cameras: One per camera; None where its pictures cannot be read.
        unreadable: Why, by name.
    """

    capture: Capture
    frames: tuple[int, ...]
    spread: tuple[int, ...]
    cameras: tuple[CameraLook | None, ...]
    unreadable: dict[str, CaptureError]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return self.capture.rig.names

    @property
    def is_consecutive(self) -> np.ndarray:
        """Whether each of the frames from the second on follows right on the one before it. [T - 1] bool"""
        return np.diff(self.frames) == 1

    def exposure(self) -> ExposureSurvey:
        """How the exposure of the cameras changes."""
        curves = {
            name: ExposureCurve(self.spread, camera.gains)
            for name, camera in zip(self.names, self.cameras, strict=True)
            if camera is not None
        }
        reasons = {name: error.message for name, error in self.unreadable.items()}
        return ExposureSurvey(self.spread, curves, len(self.names), reasons)


def frames_to_look_at(n_frames: int, n_cameras: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """All frames of a short capture; of a long one runs spread over it. And a few of them over the whole length."""
    n_most = max(MAX_PICTURES // max(n_cameras, 1), MIN_FRAMES)
    frames = range(n_frames)
    if n_frames > n_most:
        n_runs = max(n_most // RUN_LENGTH, 2)
        starts = np.linspace(0, n_frames - RUN_LENGTH, n_runs).round().astype(int)
        frames = sorted({int(start) + i for start in starts for i in range(RUN_LENGTH)})
    rows = np.unique(np.linspace(0, len(frames) - 1, min(N_SPREAD, len(frames))).round().astype(int))
    return tuple(frames), tuple(frames[row] for row in rows)


def look_at(capture: Capture, report: ReportProgress = lambda progress: None) -> PictureSurvey:
    """Decode what the checks need.

    Args:
        report: Called often, from several threads in turn; what it raises ends the work.
    """
    frames, spread = frames_to_look_at(capture.n_frames, len(capture.rig))
    n_pictures, n_done, lock = len(frames) * len(capture.rig), [0], threading.Lock()
    unreadable: dict[str, CaptureError] = {}

    def tell(name: str) -> None:
        with lock:
            n_done[0] += 1
            report(Progress(STAGE, n_done[0] / n_pictures, name))

    def look(camera: int) -> CameraLook | None:
        name = capture.rig.names[camera]
        gray, steady, gains, colors = [], [], [], []
        first: np.ndarray | None = None
        background_frames = {spread[row] for row in BACKGROUND_ROWS if row < len(spread)}
        try:
            for frame in frames:
                picture = capture.frame(camera, frame)
                tell(name)
                small = at_working_size(picture)
                gray.append(_gray(small))
                if frame in spread:
                    first = small if first is None else first
                    gains.append(gain_of(small, first))
                    steady.append(_gray(_shrunk(picture, STEADY_WIDTH_PX)))
                if frame in background_frames:
                    colors.append(_shrunk(picture, MATCH_WIDTH_PX))
        except CaptureError as error:
            unreadable[name] = error
            return None
        return CameraLook(np.stack(gray), np.stack(steady), np.stack(gains), median_picture(colors))

    return PictureSurvey(capture, frames, spread, tuple(map_ordered(look, range(len(capture.rig)))), unreadable)


def median_picture(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """The median of pictures of the same size, per value; of an even number the lower one. uint8"""
    if len(pictures) == 5:  # the usual case by comparisons alone: sorting takes ten times as long
        a, b, c, d, e = pictures
        f = np.maximum(np.minimum(a, b), np.minimum(c, d))
        g = np.minimum(np.maximum(a, b), np.maximum(c, d))
        return np.maximum(np.minimum(f, g), np.minimum(np.maximum(f, g), e))
    stack = np.stack(pictures)
    row = (len(stack) - 1) // 2
    return np.partition(stack, row, axis=0)[row]


def _gray(picture: np.ndarray) -> np.ndarray:
    return (picture.astype(np.float32).mean(-1) + 0.5).astype(np.uint8)


def _shrunk(picture: np.ndarray, width: int) -> np.ndarray:
    step = -(-picture.shape[1] // width)
    if step <= 1:
        return picture
    return resize_area(picture, (max(picture.shape[1] // step, 1), max(picture.shape[0] // step, 1)))
