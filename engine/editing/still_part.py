"""StillPart: the still part of a whole clip, as a stack of edits leaves it; only its light is worked out anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.changed_gaussians import faded, recolored, transformed
from engine.editing.effects import Effects
from engine.editing.selecting import TargetFinder
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True)
class _ColorStep:
    """A change of the colours of chosen rows: by an action, or those of another time of the clip."""

    is_chosen: Tensor
    change: Recolor | Expose | float


class StillPart:
    """The leading sets of a clip, which are the same at all times but for the light on them.

    What stands still does so however it is held or smoothed; held, it keeps the light of that moment, too.

    Args:
        lit: Gaussians of these sets at a time of the clip.
        index: Which ones they are, see ClipRows. [N] int64
        effects: The edits.
        selecting: Of the clip.
        held_time: Time of the clip at which something is held.
        has_light: Whether the light changes.
    """

    def __init__(
        self,
        lit: Callable[[float], Gaussians],
        index: np.ndarray,
        effects: Effects,
        selecting: TargetFinder,
        *,
        held_time: Callable[[Hold], float],
        has_light: bool,
    ) -> None:
        self._lit, self._has_light = lit, has_light
        shapes, everything = lit(0.0), torch.from_numpy(index)
        everything = everything.to(shapes.means.device)
        is_kept, steps = torch.ones_like(everything, dtype=torch.bool), []
        for effect in effects.all:
            is_chosen = selecting.is_chosen(effect, shapes.means, everything)
            match effect.action:
                case Hide() | Delete():
                    is_kept &= ~is_chosen
                case Transform():
                    shapes = transformed(shapes, is_chosen, effect.action)
                case Recolor():
                    shapes = replace(shapes, opacities=faded(shapes.opacities, is_chosen, effect.action))
                    steps.append(_ColorStep(is_chosen, effect.action))
                case Expose():
                    steps.append(_ColorStep(is_chosen, effect.action))
                case Hold():
                    steps.append(_ColorStep(is_chosen, held_time(effect.action)))
                case Smooth():
                    pass
        self._kept = None if is_kept.all() else is_kept.nonzero()[:, 0]
        self._shapes = shapes if self._kept is None else shapes[self._kept]
        self._steps = [_ColorStep(self._of_kept(step.is_chosen), step.change) for step in steps]
        self.index = index if self._kept is None else index[host_array(self._kept)]
        self._unchanging: Tensor | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of it."""
        tensors = [*self._shapes.tensors(), *(step.is_chosen for step in self._steps)]
        tensors += [tensor for tensor in (self._kept, self._unchanging) if tensor is not None]
        return sum(tensor.nbytes for tensor in tensors) + self.index.nbytes

    def at(self, clip_time: float) -> Gaussians:
        """The Gaussians left of the still part, at a time of the clip."""
        if self._has_light:
            return replace(self._shapes, colors=self._colors(clip_time, len(self._steps)), is_frozen=None)
        if self._unchanging is None:
            self._unchanging = self._colors(0.0, len(self._steps))
        return replace(self._shapes, colors=self._unchanging, is_frozen=None)

    def _of_kept(self, rows: Tensor) -> Tensor:
        return rows if self._kept is None else rows[self._kept]

    def _colors(self, clip_time: float, n_steps: int) -> Tensor:
        """After some of the steps. [N kept, 3]"""
        colors = self._of_kept(self._lit(clip_time).colors)
        for number, step in enumerate(self._steps[:n_steps]):
            if isinstance(step.change, Recolor | Expose):
                colors = colors.clone()
                colors[step.is_chosen] = recolored(colors[step.is_chosen], step.change)
            elif self._has_light:
                colors = torch.where(step.is_chosen[:, None], self._colors(step.change, number), colors)
        return colors
