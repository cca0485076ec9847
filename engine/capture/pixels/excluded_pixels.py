"""ExcludedPixels: which pixels of which pictures training never sees, and what stands in their place.

In the place of an excluded pixel stands that of the nearest frame of the same camera in which it is not excluded, so
that what looks at whole pictures, such as exposure and backgrounds, finds nothing odd there. It counts nowhere.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.exclusions import Exclusions, Stroke


@dataclass(frozen=True, eq=False)
class ExcludedStretch:
    """Frames [first, stop) of a camera in which the same pixels are excluded.

    Attributes:
        is_excluded: [H, W] bool, read-only; None where none is.
    """

    first: int
    stop: int
    is_excluded: np.ndarray | None

    @property
    def is_all(self) -> bool:
        """Whether nothing is left of these pictures."""
        return self.is_excluded is not None and bool(self.is_excluded.all())


class ExcludedPixels:
    """For any thread. Pixels of a camera are worked out when they are first asked for, and kept.

    Args:
        exclusions: The exclusions to apply; names of cameras that there are not do nothing.
        names: Of all cameras.
        n_frames: Frames that are worked on.
        size: Width and height of the pictures.
    """

    def __init__(self, exclusions: Exclusions, names: Sequence[str], n_frames: int, size: tuple[int, int]) -> None:
        self._exclusions, self._names, self._n_frames, self._size = exclusions, tuple(names), n_frames, size
        self._stretches: dict[int, list[ExcludedStretch]] = {}
        self._lock = threading.Lock()

    def stretches(self, camera_index: int) -> list[ExcludedStretch]:
        """All frames of a camera, in order; neighbours differ in what is excluded, or may."""
        with self._lock:
            if camera_index not in self._stretches:
                self._stretches[camera_index] = self._cut(self._names[camera_index])
            return self._stretches[camera_index]

    def of(self, camera_index: int, frame_index: int) -> np.ndarray | None:
        """Excluded pixels of a picture; None where none is. [H, W] bool, read-only"""
        return next(stretch.is_excluded for stretch in self.stretches(camera_index) if frame_index < stretch.stop)

    def always(self, camera_index: int) -> np.ndarray | None:
        """Pixels that are excluded in all frames of a camera; None where none is. [H, W] bool"""
        found: np.ndarray | None = None
        for stretch in self.stretches(camera_index):
            if stretch.is_excluded is None:
                return None
            found = stretch.is_excluded if found is None else found & stretch.is_excluded
        return None if found is None or not found.any() else found

    def fills(self, camera_index: int, frame_index: int) -> tuple[list[tuple[int, np.ndarray]], np.ndarray | None]:
        """Where excluded pixels of a picture are taken from.

        Returns:
            (frame, pixels to take from it [H, W] bool), the nearest first; and the pixels that no frame has, or None.
        """
        left = self.of(camera_index, frame_index)
        if left is None:
            return [], None
        nearest = []
        for stretch in self.stretches(camera_index):
            frame = min(max(frame_index, stretch.first), stretch.stop - 1)
            if frame != frame_index and not stretch.is_all:
                nearest.append((abs(frame - frame_index), frame, stretch))
        found = []
        for _, frame, stretch in sorted(nearest, key=lambda one: one[:2]):
            taken = left if stretch.is_excluded is None else left & ~stretch.is_excluded
            if taken.any():
                found.append((frame, taken))
                left = left & ~taken
            if not left.any():
                return found, None
        return found, left

    def _cut(self, name: str) -> list[ExcludedStretch]:
        n_frames, (width, height) = self._n_frames, self._size
        everything = np.ones((height, width), bool)
        everything.flags.writeable = False
        if name in self._exclusions.cameras:
            return [ExcludedStretch(0, n_frames, everything)]
        frames = [one for one in self._exclusions.frames if one.camera in (None, name)]
        masks = [(one, self._painted(one.strokes)) for one in self._exclusions.masks if one.camera == name]
        ends = {0, n_frames}
        for one in (*frames, *(mask for mask, _ in masks)):
            ends |= {min(one.first, n_frames), min(one.stop, n_frames)}
        bounds = sorted(ends)
        stretches = []
        for first, stop in itertools.pairwise(bounds):
            if any(one.first <= first < one.stop for one in frames):
                stretches.append(ExcludedStretch(first, stop, everything))
                continue
            here = [pixels for mask, pixels in masks if mask.first <= first < mask.stop]
            is_excluded = np.logical_or.reduce(here) if here else None
            if is_excluded is not None:
                is_excluded = is_excluded if is_excluded.any() else None
            stretches.append(ExcludedStretch(first, stop, is_excluded))
        return stretches

    def _painted(self, strokes: Sequence[Stroke]) -> np.ndarray:
        return painted_pixels(strokes, *self._size)


def painted_pixels(strokes: Sequence[Stroke], width: int, height: int) -> np.ndarray:
    """Pixels whose centre lies under strokes of a round brush, painted and erased in order. [height, width] bool"""
    is_painted = np.zeros((height, width), bool)
    for stroke in strokes:
        points = np.array(stroke.points, np.float64) * (width, height)
        radius = stroke.radius * width
        for start, end in zip(points, points[1:] if len(points) > 1 else points, strict=False):
            low = np.floor(np.minimum(start, end) - radius - 0.5).astype(int)
            high = np.ceil(np.maximum(start, end) + radius + 0.5).astype(int)
            x0, y0 = np.clip(low, 0, (width, height))
            x1, y1 = np.clip(high, 0, (width, height))
            if x0 >= x1 or y0 >= y1:
                continue
            xs, ys = np.arange(x0, x1) + 0.5, np.arange(y0, y1)[:, None] + 0.5
            along = end - start
            length = float(along @ along)
            share = np.clip(((xs - start[0]) * along[0] + (ys - start[1]) * along[1]) / max(length, 1e-12), 0.0, 1.0)
            squared = (xs - start[0] - share * along[0]) ** 2 + (ys - start[1] - share * along[1]) ** 2
            is_painted[y0:y1, x0:x1][squared <= radius * radius] = not stroke.is_erasing
    is_painted.flags.writeable = False
    return is_painted
