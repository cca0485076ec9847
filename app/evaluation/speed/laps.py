"""Laps: pictures rendered to measure the speed, and the medians of their times.

A lap is one picture of one frame, from nothing decoded to a picture in main memory. Pictures are those of one camera at
the size of the capture, of frames spread over the first and the last trained clip; the first picture of a clip does not
count, as it fills caches.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.evaluation.headless import TrainedProject

N_FRAMES = 5
"""Frames of a clip that count, at most."""
ENOUGH_S, ENOUGH_LAPS = 4.0, 3
"""After both, the rate is accurate enough."""


class Lap(NamedTuple):
    """One picture.

    Attributes:
        decode_s: Seconds from the model of the clip to the Gaussians of the frame.
        draw_s: Seconds from those to the picture.
        n_gaussians: Gaussians that were drawn.
    """

    decode_s: float
    draw_s: float
    n_gaussians: int


@dataclass(frozen=True, slots=True)
class RenderRate:
    """How fast pictures are rendered, by medians over laps.

    Attributes:
        fps: Pictures per second, decoding included.
        fps_drawing: The same of Gaussians that are decoded already, as the window keeps them.
        n_gaussians: Drawn in a picture.
        n_laps: Pictures that count.
        drawn_by: The renderer, such as "CPU rasterizer, 2 threads".
    """

    fps: float
    fps_drawing: float
    n_gaussians: int
    n_laps: int
    drawn_by: str


def rate_of(laps: Sequence[Lap], drawn_by: str) -> RenderRate | None:
    """The rate of at least one lap; None without, and where the clock stood still."""
    if not laps:
        return None
    whole = statistics.median(lap.decode_s + lap.draw_s for lap in laps)
    drawing = statistics.median(lap.draw_s for lap in laps)
    n_gaussians = round(statistics.median(lap.n_gaussians for lap in laps))
    if not whole > 0 or not drawing > 0:
        return None
    return RenderRate(1.0 / whole, 1.0 / drawing, n_gaussians, len(laps), drawn_by)


def camera_of(opened: TrainedProject) -> int:
    """Index of the camera whose pictures are rendered: the first that is held out, else the first."""
    names, holdout = opened.capture.rig.names, set(opened.project.settings.holdout)
    return next((index for index, name in enumerate(names) if name in holdout), 0)


def frames_of(opened: TrainedProject) -> dict[int, list[int]]:
    """Frames to render by clip: the one that does not count first, then those that do."""
    found = {}
    for clip_index in sorted({opened.trained[0], opened.trained[-1]}):
        frames = list(opened.clips[clip_index].frame_indices())
        spread = np.linspace(0, len(frames) - 1, min(N_FRAMES, len(frames))).round().astype(int)
        found[clip_index] = [frames[-1], *(frames[at] for at in spread)]
    return found


def enough(laps: Iterable[Lap]) -> Iterator[Lap]:
    """The first laps, until they have taken ENOUGH_S and are ENOUGH_LAPS at least."""
    spent_s = 0.0
    for number, lap in enumerate(laps, start=1):
        yield lap
        spent_s += lap.decode_s + lap.draw_s
        if spent_s >= ENOUGH_S and number >= ENOUGH_LAPS:
            return
