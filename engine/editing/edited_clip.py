"""EditedClip: the Gaussians of a loaded clip at a moment, as a stack of edits leaves them.

What stands still in the whole clip comes first and is worked out once for each stack; only its light changes from
moment to moment. What moves is decoded and gone through moment by moment. Without edits nothing is done but decoding.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from engine.byte_cache import ByteCache
from engine.capture.clip import Clip
from engine.clip_files.roles import STATIC
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.changed_gaussians import faded, recolored, transformed
from engine.editing.clip_rows import ClipRows, NamedSet
from engine.editing.effects import NO_EFFECTS, Effect, Effects
from engine.editing.fills.filled import filled_by
from engine.editing.gaussian_rows import GaussianRows
from engine.editing.over_time import Chosen, IndexedGaussians, held, smoothed
from engine.editing.selecting import TargetFinder
from engine.editing.still_part import StillPart
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians

MAX_STILL = 4
"""Stacks for which the still part is kept: those at the playhead, and those of a drag a moment ago."""
REACH_SIGMAS = 3.0
"""Frames farther away than so many standard deviations do not count."""
FRAME_BYTES = 48 << 20
"""Frames of the clip that are kept while edits smooth over time."""


@dataclass(frozen=True, slots=True, eq=False)
class EditedGaussians:
    """A moment of a clip.

    Attributes:
        gaussians: The Gaussians left, sets in the order of the model, those of fills last.
        rows: Where each comes from.
        n_still: So many come first and differ in nothing but their colours between moments with equal effects.
    """

    gaussians: Gaussians
    rows: GaussianRows
    n_still: int


class EditedClip:
    """A clip, or a part of one, with edits. For one thread; the model is not changed.

    Args:
        model: The model to decode; nothing in it learns.
        clip: Its frames.
        named: The sets of the whole clip, see engine.editing.clip_rows.named_sets.
    """

    def __init__(self, model: ClipModel, clip: Clip, named: Mapping[str, NamedSet]) -> None:
        self.model, self.clip = model, clip
        self.rows = ClipRows(model, named)
        self._selecting = TargetFinder(self.rows, model.backend.device)
        n_still, k = model.n_constant_rows(), model.decoder.gaussians_per_anchor
        self._still_roles: list[str] = []
        for role in model.roles():  # the leading ones
            if n_still <= 0:
                break
            self._still_roles.append(role)
            n_still -= k * len(model.anchor_set(role))
        self._still_index = self._indices({role: np.arange(len(model.anchor_set(role))) for role in self._still_roles})
        self._still: OrderedDict[Effects, StillPart] = OrderedDict()
        self._frames: ByteCache[tuple[tuple[Effect, ...], int], IndexedGaussians] = ByteCache(FRAME_BYTES)

    @torch.no_grad()
    def decode(
        self, clip_time: float, effects: Effects = NO_EFFECTS, *, alive_at: float | None = None
    ) -> EditedGaussians:
        """The Gaussians seen at a time of the clip.

        Args:
            clip_time: See ClipModel.decode.
            effects: The edits that hold then.
            alive_at: The time of the clip that says which anchors exist; None for `clip_time`.
        Raises:
            ProjectError: An edit is damaged.
        """
        alive = clip_time if alive_at is None else alive_at
        if not effects:
            rows = {role: self.model.alive(role, alive) for role in self.model.roles()}
            index = self._indices({role: host_array(found) for role, found in rows.items()})
            gaussians = self._decoded(clip_time, rows)
            return EditedGaussians(gaussians, self.rows.named(index), len(self._still_index))
        still = self._still_part(effects)
        moving = self._moving(effects.all, clip_time, alive)
        gaussians = Gaussians.concatenate([still.at(clip_time), moving.gaussians])
        index = np.concatenate([still.index, host_array(moving.index)])
        return self._with_fills(EditedGaussians(gaussians, self.rows.named(index), len(still.index)), effects)

    def _with_fills(self, edited: EditedGaussians, effects: Effects) -> EditedGaussians:
        """Followed by the Gaussians of fills, which belong to the still part of the scene."""
        filled = filled_by(effects, edited.gaussians.means) if STATIC in self.model.roles() else None
        if filled is None:
            return edited
        gaussians = Gaussians.concatenate([edited.gaussians, filled.gaussians])
        return EditedGaussians(gaussians, filled.rows(edited.rows, self.clip.clip_index), edited.n_still)

    @property
    def n_bytes_kept(self) -> int:
        """Memory kept between moments, apart from the model."""
        return sum(part.n_bytes for part in self._still.values()) + self._frames.n_bytes

    # ---------------------------------------------------------------- the still part

    def _still_part(self, effects: Effects) -> StillPart:
        if effects in self._still:
            self._still.move_to_end(effects)
            return self._still[effects]
        self._still[effects] = part = StillPart(
            self._lit,
            self._still_index,
            effects,
            self._selecting,
            held_time=lambda action: self._held_frame(action) / self.clip.clip_length,
            has_light=self.model.has_light,
        )
        while len(self._still) > MAX_STILL:
            self._still.popitem(last=False)
        return part

    def _lit(self, clip_time: float) -> Gaussians:
        if not self._still_roles:
            return self._decoded(clip_time, {})
        parts = [self.model.lit_gaussians(role, clip_time) for role in self._still_roles]
        return parts[0] if len(parts) == 1 else Gaussians.concatenate(parts)

    # ---------------------------------------------------------------- the moving part

    def _moving(self, effects: tuple[Effect, ...], clip_time: float, alive_at: float) -> IndexedGaussians:
        """The Gaussians that do not stand still, after some effects."""
        now = self._unedited(clip_time, alive_at)
        for number, effect in enumerate(effects):
            before, chosen = effects[:number], self._chosen(effect)
            match effect.action:
                case Hide() | Delete():
                    now = now[~chosen(now)]
                case Transform():
                    now = replace(now, gaussians=transformed(now.gaussians, chosen(now), effect.action))
                case Recolor() | Expose():
                    now = replace(now, gaussians=_recolored(now.gaussians, chosen(now), effect.action))
                case Hold():
                    now = held(now, self._at_frame(before, self._held_frame(effect.action)), chosen, self.rows.n)
                case Smooth():
                    frames = self._frames_around(before, clip_time, effect.action.sigma_frames)
                    now = smoothed(now, frames, chosen, self.rows.n)
        return now

    def _at_frame(self, effects: tuple[Effect, ...], frame_in_clip: int) -> IndexedGaussians:
        """The same at a frame of the clip. Kept: each frame of a held or smoothed clip asks for it."""
        known = self._frames.get((effects, frame_in_clip))
        if known is None:
            clip_time = frame_in_clip / self.clip.clip_length
            known = self._moving(effects, clip_time, clip_time)
            self._frames.put((effects, frame_in_clip), known, known.n_bytes)
        return known

    def _chosen(self, effect: Effect) -> Chosen:
        return lambda found: self._selecting.is_chosen(effect, found.gaussians.means, found.index)

    def _unedited(self, clip_time: float, alive_at: float) -> IndexedGaussians:
        moving = [role for role in self.model.roles() if role not in self._still_roles]
        rows = {role: self.model.alive(role, alive_at) for role in moving}
        index = self._indices({role: host_array(found) for role, found in rows.items()})
        nothing = torch.zeros(0, dtype=torch.int64, device=self.model.backend.device)
        gaussians = self._decoded(clip_time, dict.fromkeys(self._still_roles, nothing) | rows)
        return IndexedGaussians(replace(gaussians, is_frozen=None), torch.from_numpy(index).to(nothing.device))

    def _held_frame(self, action: Hold) -> int:
        return min(max(action.frame_index - self.clip.start, 0), self.clip.n_frames - 1)

    def _frames_around(
        self, effects: tuple[Effect, ...], clip_time: float, sigma: float
    ) -> list[tuple[float, IndexedGaussians]]:
        """Frames of the clip near a time of it, after some effects, and their weights; the nearest first."""
        clip = self.clip
        position = min(max(clip_time * clip.clip_length, 0.0), clip.n_frames - 1.0)
        reach = max(REACH_SIGMAS * sigma, 1.0)
        near = [frame for frame in range(clip.n_frames) if abs(frame - position) <= reach]
        near.sort(key=lambda frame: (abs(frame - position), frame))
        weights = [math.exp(-0.5 * ((frame - position) / sigma) ** 2) for frame in near]
        return [(weight, self._at_frame(effects, frame)) for weight, frame in zip(weights, near, strict=True)]

    # ---------------------------------------------------------------- decoding

    def _indices(self, rows: Mapping[str, np.ndarray]) -> np.ndarray:
        found = [self.rows.indices(role, chosen) for role, chosen in rows.items()]
        return np.concatenate([np.zeros(0, np.int64), *found])

    def _decoded(self, clip_time: float, rows: dict[str, Tensor]) -> Gaussians:
        if not rows:  # a part without anchors
            options = {"dtype": self.model.backend.dtype, "device": self.model.backend.device}
            return Gaussians(*(torch.zeros(0, *width, **options) for width in ((3,), (4,), (3,), (), (3,))))
        return self.model.decode(clip_time, rows).detach()


def _recolored(gaussians: Gaussians, is_chosen: Tensor, action: Recolor | Expose) -> Gaussians:
    colors, opacities = gaussians.colors.clone(), gaussians.opacities
    colors[is_chosen] = recolored(colors[is_chosen], action)
    if isinstance(action, Recolor):
        opacities = faded(opacities, is_chosen, action)
    return replace(gaussians, colors=colors, opacities=opacities)
