"""Selecting: which Gaussians of a clip an effect acts on, with their centres as the edits before it have left them."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
import torch
from torch import Tensor

from engine.camera.rotations import matrices_of
from engine.editing.clip_rows import ClipRows
from engine.editing.edit import Box, Everything, Picked, Prism, Sphere, Volume
from engine.editing.effects import Effect
from engine.editing.volumes.prisms import in_prism
from engine.model.host_array import host_array

MAX_TABLES = 64
"""Sets of picked Gaussians that are kept unpacked, a byte per Gaussian of the clip."""


class TargetFinder:
    """Targets looked up in one clip. For one thread.

    Args:
        rows: Of the clip.
        device: Of its tensors.
    """

    def __init__(self, rows: ClipRows, device: torch.device | str) -> None:
        self._rows, self._device = rows, device
        self._picked: OrderedDict[Picked, Tensor | None] = OrderedDict()
        self._is_of_reference = torch.from_numpy(rows.is_of_reference).to(device)

    def is_chosen(self, effect: Effect, means: Tensor, index: Tensor) -> Tensor:
        """Whether an effect acts on each of some Gaussians. [N] bool

        The target is inverted, not whether it must come from the reference clip. Picks from before a clip was
        trained anew stand for nothing, inverted or not. A centre that is not finite lies in no volume.

        Args:
            means: Their centres now. [N, 3]
            index: See ClipRows. [N] int64
        Raises:
            ProjectError: Picked numbers are damaged.
        """
        match effect.target:
            case Everything() | Box() | Sphere() | Prism():
                is_meant = is_within(effect.target, means)
            case Picked():
                table = self._table(effect.target)
                if table is None:
                    return torch.zeros(len(index), dtype=torch.bool, device=self._device)
                is_meant = table[index]
        is_chosen = ~is_meant if effect.is_inverted else is_meant
        return is_chosen & self._is_of_reference[index] if effect.is_reference_only else is_chosen

    def _table(self, target: Picked) -> Tensor | None:
        """Whether each Gaussian of the clip is picked; None where picks stand for nothing here."""
        if target in self._picked:
            self._picked.move_to_end(target)
            return self._picked[target]
        table = None
        if not self._rows.is_lost(target):
            table = torch.from_numpy(self._rows.is_picked(target)).to(self._device)
        self._picked[target] = table
        while len(self._picked) > MAX_TABLES:
            self._picked.popitem(last=False)
        return table


def is_within(target: Everything | Volume, means: Tensor) -> Tensor:
    """Which centres [N, 3] lie in a volume. [N] bool"""
    match target:
        case Everything():
            return torch.ones(len(means), dtype=torch.bool, device=means.device)
        case Box():
            return _is_in_box(means, target)
        case Sphere():
            away = means.double() - means.new_tensor(target.center, dtype=torch.float64)
            return (away * away).sum(1) <= target.radius**2
        case Prism():
            return torch.from_numpy(in_prism(target, host_array(means))).to(means.device)


def _is_in_box(means: Tensor, box: Box) -> Tensor:
    quat = np.asarray(box.quat, np.float64)
    axes = torch.from_numpy(matrices_of(quat / np.linalg.norm(quat))).to(means.device)
    along = (means.double() - means.new_tensor(box.center, dtype=torch.float64)) @ axes
    return (along.abs() <= along.new_tensor(box.half_sizes)).all(1)
