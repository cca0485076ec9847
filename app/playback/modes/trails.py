"""Trails: the ways that Gaussians took over the last frames of a clip. Decoded on a separate thread."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_decoding
from app.background.latest import LatestWorker
from app.playback.modes import hues
from app.playback.modes.contents import EditedParts
from engine.capture.clip import Clip
from engine.editing.effects import Effects

if TYPE_CHECKING:
    from engine.editing.edited_clip import EditedClip

N_FRAMES = 8
"""As many frames back."""
N_TRAILS = 300
"""As many Gaussians: those that went farthest."""
MIN_OPACITY = 0.2
"""Fainter Gaussians are hardly seen."""
OLDEST_OPACITY = 0.1
"""Of the oldest end of a trail; the newest end is opaque."""


@dataclass(frozen=True, slots=True, eq=False)
class Trails:
    """Trails as lines.

    Attributes:
        vertices: Two per line, scene units. [2 L, 3] float32
        colors: RGBA in 0..1. [2 L, 4] float32
        key: Changes when the content does.
    """

    vertices: np.ndarray
    colors: np.ndarray
    key: Hashable


@dataclass(frozen=True, slots=True)
class TrailRequest:
    """Trails that end at a frame of a clip. Equal keys are equal states of equal clips.

    Attributes:
        effects: Of the edits that hold in the frames of `trail_frames`.
    """

    model_key: Hashable
    frame_index: int
    effects: tuple[Effects, ...]
    parts: EditedParts = field(compare=False)


class TrailMaker:
    """Trails on demand; the newest request wins. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[TrailRequest, Trails] = LatestWorker("trails", self._make, prepare=prepare_decoding)
        self._part: tuple[Hashable, EditedClip] | None = None

    def trails(self, request: TrailRequest) -> Trails | None:
        """The trails if they are ready, otherwise the newest ones of the same clip; None before the first."""
        newest = self.worker.newest
        if newest is None or newest[0] != request:
            self.worker.request(request)
        return newest[1] if newest is not None and newest[0].model_key == request.model_key else None

    def clear(self) -> None:
        """Forget the trails."""
        self.worker.forget()

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    def _make(self, request: TrailRequest) -> Trails:
        if self._part is None or self._part[0] != request.model_key:
            self._part = (request.model_key, request.parts.apart("dynamic"))
        paths, opacities = paths_of(self._part[1], request.frame_index, request.effects)
        vertices, colors = trail_lines(paths, opacities)
        return Trails(vertices, colors, (request.model_key, request.frame_index))


def trail_frames(clip: Clip, frame_index: int) -> range:
    """Frames of the clip through which a trail goes that ends at one of them."""
    return range(max(clip.start, frame_index - N_FRAMES + 1), frame_index + 1)


def paths_of(part: EditedClip, frame_index: int, effects: Sequence[Effects]) -> tuple[np.ndarray, np.ndarray]:
    """Where the Gaussians of a frame were in the frames before it, within the clip.

    Args:
        part: Anchors that move.
        effects: Of each frame of `trail_frames`.
    Returns:
        paths: Oldest first, the frame itself last; NaN where there was no such Gaussian. [T, N, 3] float32
        opacities: At the frame itself. [N]
    """
    from engine.model.host_array import host_array

    clip = part.clip
    now = part.decode(clip.clip_time(frame_index), effects[-1])
    place = part.rows.indices_of(now.rows)
    paths = []
    for frame, held in zip(trail_frames(clip, frame_index), effects, strict=True):
        then = now if frame == frame_index else part.decode(clip.clip_time(frame), held)
        known = np.full((part.rows.n, 3), np.nan, np.float32)
        known[part.rows.indices_of(then.rows)] = host_array(then.gaussians.means)
        paths.append(known[place])
    return np.stack(paths), host_array(now.gaussians.opacities)


def trail_lines(paths: np.ndarray, opacities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lines along the longest of these paths, fading towards their old ends; a path ends where its Gaussian began.

    Args:
        paths: [T, N, 3], see `paths_of`.
        opacities: [N]
    Returns:
        vertices: [2 L, 3] float32
        colors: [2 L, 4] float32
    """
    steps = np.diff(paths, axis=0)  # [T - 1, N, 3]
    is_step = np.all(np.isfinite(steps), axis=2)
    is_whole = np.cumprod(is_step[::-1], axis=0)[::-1].astype(bool)  # up to the frame itself without a gap
    lengths = (np.linalg.norm(np.nan_to_num(steps), axis=2) * is_whole).sum(axis=0)
    order = np.argsort(-lengths, kind="stable")
    chosen = order[(lengths[order] > 0.0) & (opacities[order] >= MIN_OPACITY)][:N_TRAILS]
    segments = np.stack([paths[:-1, chosen], paths[1:, chosen]], axis=2)  # [T - 1, n, 2, 3]
    ages = np.linspace(OLDEST_OPACITY, 1.0, max(len(paths), 1))
    colors = np.empty((*segments.shape[:3], 4), np.float32)
    colors[..., :3] = hues.YELLOW
    colors[..., 3] = np.stack([ages[:-1], ages[1:]], axis=-1)[:, None, :]
    is_drawn = is_whole[:, chosen]
    return segments[is_drawn].reshape(-1, 3), colors[is_drawn].reshape(-1, 4)
