"""MovingParts: what moves in a clip, as points followed over its frames; what an object can be made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from engine.editing.edited_clip import EditedClip
from engine.editing.gaussian_rows import GaussianRows
from engine.model.host_array import host_array

ROLES = ("moving", "residual", "adapted")
"""Sets that travel; others stand still, whatever the light on them does."""
LEAST_OPACITY = 0.03
"""Gaussians that are fainter in all frames are not followed: they get what their anchor gets."""
MAX_FRAMES = 24
"""Frames of a clip that are looked at; of a longer clip these are evenly spread."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingParts:
    """Gaussians of a clip that travel, in frames of it.

    Attributes:
        start, stop: First frame of the clip, and one after its last.
        frames: Those looked at, frames of the capture, the first and the last among them. [F]
        index: Which Gaussians they are, rising; see ClipRows. [N] int64
        anchor: Number that Gaussians of the same anchor share. [N] int64
        means: Centres, scene units; meaningless where absent. [F, N, 3] float32
        opacities: 0 where absent. [F, N] float32
        colors: Mean over the frames, display-encoded. [N, 3] float32
        sizes: Mean scale, scene units. [N] float32
        rows: Where each comes from.
    """

    start: int
    stop: int
    frames: tuple[int, ...]
    index: np.ndarray
    anchor: np.ndarray
    means: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray
    sizes: np.ndarray
    rows: GaussianRows

    def __len__(self) -> int:
        return len(self.index)

    @property
    def mass(self) -> np.ndarray:
        """How much of a picture each makes up, as far as a number can say: opacity times area. [N]"""
        return self.opacities.mean(0) * np.maximum(self.sizes, 1e-9) ** 2

    def at_border(self, *, is_end: bool) -> tuple[np.ndarray, np.ndarray]:
        """Where each is half a frame outside of the clip, and how opaque; it goes on as between the outermost frames.

        Args:
            is_end: After the last frame, else before the first one.
        Returns:
            Centres [N, 3], opacities [N], 0 where it is absent.
        """
        last, before = (-1, -2) if is_end else (0, 1)
        here = self.means[last]
        n_frames = abs(self.frames[last] - self.frames[before]) if len(self.frames) > 1 else 1
        both = (self.opacities[last] > 0) & (self.opacities[before] > 0) if len(self.frames) > 1 else None
        if both is None:
            return here, self.opacities[last]
        step = np.where(both[:, None], (here - self.means[before]) / n_frames, 0.0)
        return (here + 0.5 * step).astype(np.float32), self.opacities[last]


def frames_of(start: int, n_frames: int) -> tuple[int, ...]:
    """Frames to look at: the two outermost at both ends, which say how things cross the border, and others between."""
    inner = np.linspace(1, n_frames - 2, min(MAX_FRAMES, n_frames) - 2).round() if n_frames > 3 else range(n_frames)
    return tuple(start + frame for frame in sorted({0, n_frames - 1, *map(int, inner)}))


@torch.no_grad()
def moving_parts(edited: EditedClip, frames: Sequence[int] | None = None) -> MovingParts:
    """Follow what moves in a clip.

    Args:
        edited: The clip; its edits do not count.
        frames: Of the capture; None for `frames_of` the clip.
    """
    model, clip = edited.model, edited.clip
    k = model.decoder.gaussians_per_anchor
    roles = [role for role in model.roles() if role in ROLES]
    frames = frames_of(clip.start, clip.n_frames) if frames is None else tuple(frames)
    nothing = torch.zeros(0, dtype=torch.int64, device=model.backend.device)
    size = edited.rows.n
    means = np.zeros((len(frames), size, 3), np.float32)
    opacities = np.zeros((len(frames), size), np.float32)
    colors, sizes, weight = np.zeros((size, 3), np.float64), np.zeros(size), np.zeros(size)
    for place, frame in enumerate(frames if roles else ()):
        clip_time = clip.clip_time(frame)
        rows = {role: model.alive(role, clip_time) if role in roles else nothing for role in model.roles()}
        found = model.decode(clip_time, rows)
        index = np.concatenate([edited.rows.indices(role, host_array(rows[role])) for role in roles])
        centres, opacity, color, scales = (
            host_array(tensor.detach()) for tensor in (found.means, found.opacities, found.colors, found.scales)
        )
        is_sound = np.isfinite(centres).all(1) & np.isfinite(opacity)
        index, centres, opacity = index[is_sound], centres[is_sound], opacity[is_sound]
        means[place, index], opacities[place, index] = centres, opacity
        colors[index] += opacity[:, None] * color[is_sound]
        sizes[index] += opacity * scales[is_sound].mean(1)
        weight[index] += opacity
    index = np.flatnonzero(opacities.max(0, initial=0.0) >= LEAST_OPACITY)
    share = np.maximum(weight[index], 1e-9)
    return MovingParts(
        clip.start,
        clip.stop,
        frames,
        index,
        index // k,
        means[:, index],
        opacities[:, index],
        (colors[index] / share[:, None]).astype(np.float32),
        (sizes[index] / share).astype(np.float32),
        edited.rows.named(index),
    )
