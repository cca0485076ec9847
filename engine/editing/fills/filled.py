"""The Gaussians of fills, as the edits above them leave them: the same at all times at which these edits hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from engine.editing.actions import Delete, Expose, Hide, Recolor, Transform
from engine.editing.changed_gaussians import faded, recolored, transformed
from engine.editing.edit import Picked
from engine.editing.effects import Effect, Effects
from engine.editing.fills.fill import FILLED, GUESSED, unpacked_fill
from engine.editing.gaussian_rows import GaussianRows, RowSet
from engine.editing.selecting import is_within
from engine.errors import ProjectError
from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True, eq=False)
class Filled:
    """What the fills of a stack show.

    Attributes:
        gaussians: Of all fills, the first edit's first.
        is_guess: Whether nothing of its place was ever seen. [N] bool
    """

    gaussians: Gaussians
    is_guess: np.ndarray

    def rows(self, rows: GaussianRows, clip_index: int) -> GaussianRows:
        """Rows of a clip followed by those of these Gaussians, which come from no anchor."""
        sets = (*rows.sets, RowSet("", clip_index, FILLED), RowSet("", clip_index, GUESSED))
        set_index = (len(rows.sets) + self.is_guess).astype(np.uint8)
        number = np.arange(len(self.is_guess), dtype=np.int32)
        return GaussianRows(sets, np.concatenate([rows.set_index, set_index]), np.concatenate([rows.number, number]))


def filled_by(effects: Effects, like: Tensor) -> Filled | None:
    """The Gaussians of all fills of a stack; None where there are none.

    What is picked was picked among anchors: edits above act on a fill by volume, or on everything but their picks.

    Args:
        effects: Of a moment.
        like: A tensor with the dtype and device to use.
    Raises:
        ProjectError: A fill is damaged.
    """
    now: Filled | None = None
    for effect in effects.all:
        if now is not None:
            now = _after(now, effect)
        if effect.filled:
            own = _unpacked(effect.filled, like)
            now = own if now is None else _joined(now, own)
    return now if now is not None and len(now.is_guess) else None


def _unpacked(packed: bytes, like: Tensor) -> Filled:
    try:
        found = unpacked_fill(packed)
    except ValueError as error:
        hint = "Remove its fill, and fill behind it again."
        raise ProjectError(f"An edit cannot be applied: {error}.", hint=hint) from error
    columns = (found.means, found.quats, found.scales, found.opacities, found.colors)
    return Filled(Gaussians(*(torch.tensor(column).to(like) for column in columns)), found.is_guess)


def _joined(before: Filled, own: Filled) -> Filled:
    gaussians = Gaussians.concatenate([before.gaussians, own.gaussians])
    return Filled(gaussians, np.concatenate([before.is_guess, own.is_guess]))


def _after(now: Filled, effect: Effect) -> Filled:
    """After one more effect."""
    means = now.gaussians.means
    if isinstance(effect.target, Picked):
        is_meant = torch.zeros(len(means), dtype=torch.bool, device=means.device)
    else:
        is_meant = is_within(effect.target, means)
    is_chosen = (~is_meant if effect.is_inverted else is_meant) & (not effect.is_reference_only)
    gaussians, action = now.gaussians, effect.action
    match action:
        case Hide() | Delete():
            return Filled(gaussians[~is_chosen], now.is_guess[(~is_chosen).cpu().numpy()])
        case Transform():
            return replace(now, gaussians=transformed(gaussians, is_chosen, action))
        case Recolor() | Expose():
            colors = gaussians.colors.clone()
            colors[is_chosen] = recolored(colors[is_chosen], action)
            opacities = gaussians.opacities
            if isinstance(action, Recolor):
                opacities = faded(opacities, is_chosen, action)
            return replace(now, gaussians=replace(gaussians, colors=colors, opacities=opacities))
        case _:  # still already
            return now
