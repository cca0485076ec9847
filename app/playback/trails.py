"""Trails: the ways that Gaussians took over the last frames of a clip. Decoded on a thread of their own."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_decoding
from app.background.latest import LatestWorker
from app.playback import hues
from app.playback.contents import part_of
from engine.capture.clip import Clip

if TYPE_CHECKING:
    from engine.model.clip_model import ClipModel

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
    """Trails that end at a frame of a clip. Equal keys are equal states of equal clips."""

    model_key: Hashable
    frame_index: int
    model: ClipModel = field(compare=False)
    clip: Clip = field(compare=False)


class TrailMaker:
    """Trails on demand; the newest request wins. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[TrailRequest, Trails] = LatestWorker("trails", self._make, prepare=prepare_decoding)
        self._part: tuple[Hashable, ClipModel] | None = None

    def trails(self, request: TrailRequest) -> Trails | None:
        """The trails if they are ready, otherwise the newest ones of the same clip; None before the first."""
        newest = self.worker.newest
        if newest is None or newest[0] != request:
            self.worker.request(request)
        return newest[1] if newest is not None and newest[0].model_key == request.model_key else None

    def clear(self) -> None:
        """Forget what was made."""
        self.worker.forget()

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    def _make(self, request: TrailRequest) -> Trails:
        if self._part is None or self._part[0] != request.model_key:
            self._part = (request.model_key, part_of(request.model, "dynamic"))
        paths, opacities = paths_of(self._part[1], request.clip, request.frame_index)
        vertices, colors = trail_lines(paths, opacities)
        return Trails(vertices, colors, (request.model_key, request.frame_index))


def paths_of(part: ClipModel, clip: Clip, frame_index: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the Gaussians of a frame were in the frames before it, within the clip.

    Args:
        part: Anchors that move.
    Returns:
        paths: Oldest first, the frame itself last; NaN where the anchor did not exist. [T, N, 3] float32
        opacities: At the frame itself. [N]
    """
    import torch

    from engine.model.host_array import host_array

    frames = range(max(clip.start, frame_index - N_FRAMES + 1), frame_index + 1)
    if not part.roles():
        return np.zeros((len(frames), 0, 3), np.float32), np.zeros(0, np.float32)
    k, now = part.decoder.gaussians_per_anchor, clip.clip_time(frame_index)
    rows = {role: part.alive(role, now) for role in part.roles()}
    paths, opacities = [], np.zeros(0, np.float32)
    with torch.no_grad():
        for frame in frames:
            clip_time = clip.clip_time(frame)
            gaussians = part.decode(clip_time, rows)
            is_there = [np.isin(host_array(rows[role]), host_array(part.alive(role, clip_time))) for role in rows]
            exists = np.repeat(np.concatenate(is_there), k)
            paths.append(np.where(exists[:, None], host_array(gaussians.means), np.nan).astype(np.float32))
            opacities = host_array(gaussians.opacities)
    return np.stack(paths), opacities


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
