"""Edits that look at other moments of a clip: standing still as at one frame, and changing more slowly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from engine.raster.gaussians import Gaussians

SMALLEST_SCALE = 1e-30
"""Keeps logarithms of scales finite."""


@dataclass(frozen=True, slots=True, eq=False)
class IndexedGaussians:
    """Gaussians of a clip and which ones they are, rising; see ClipRows. index: [N] int64"""

    gaussians: Gaussians
    index: Tensor

    def __getitem__(self, rows: Tensor) -> IndexedGaussians:
        return IndexedGaussians(self.gaussians[rows], self.index[rows])

    @property
    def n_bytes(self) -> int:
        """Memory of all of it."""
        return sum(tensor.nbytes for tensor in (*self.gaussians.tensors(), self.index))

    def joined(self, others: IndexedGaussians) -> IndexedGaussians:
        """Both, rising; none of them is in the other."""
        index = torch.cat([self.index, others.index])
        order = index.argsort()
        return IndexedGaussians(Gaussians.concatenate([self.gaussians, others.gaussians])[order], index[order])


Chosen = Callable[[IndexedGaussians], Tensor]
"""Which of some Gaussians an edit acts on. [N] bool"""


def held(now: IndexedGaussians, then: IndexedGaussians, is_chosen: Chosen, n: int) -> IndexedGaussians:
    """Now, but what was chosen at another moment is as it was then.

    Of what did not exist then it is asked now whether it is chosen; it is left out if so.

    Args:
        n: Gaussians of the clip.
    """
    was_chosen = is_chosen(then)
    is_gone = torch.zeros(n, dtype=torch.bool, device=now.index.device)
    is_gone[now.index[is_chosen(now)]] = True
    is_gone[then.index] = was_chosen
    return now[~is_gone[now.index]].joined(then[was_chosen])


def smoothed(
    now: IndexedGaussians,
    frames: Sequence[tuple[float, IndexedGaussians]],
    is_chosen: Chosen,
    n: int,
) -> IndexedGaussians:
    """Now, but what is chosen is a weighted mean over frames.

    Where it does not exist, its opacity counts as zero and the rest of it not at all: what comes and goes fades in and
    out. Of what does not exist now, the nearest frame in which it does says whether it is chosen. A Gaussian with a
    number that is not finite counts as one that does not exist.

    Args:
        frames: Weight and content of each, the nearest first.
        n: Gaussians of the clip.
    """
    device = now.index.device
    meant = torch.zeros(n, dtype=torch.bool, device=device)
    for _, found in reversed(frames):
        meant[found.index] = is_chosen(found)
    meant[now.index] = is_chosen(now)
    index = meant.nonzero()[:, 0]
    place = torch.zeros(n, dtype=torch.int64, device=device)
    place[index] = torch.arange(len(index), device=device)
    mean = _Mean(len(index), device)
    for weight, found in frames:
        rows = meant[found.index] & _is_finite(found.gaussians)
        mean.add(weight, found.gaussians[rows], place[found.index[rows]])
    result, is_known = mean.result(now.gaussians.means.dtype)
    return now[~meant[now.index]].joined(IndexedGaussians(result, index[is_known]))


def _is_finite(gaussians: Gaussians) -> Tensor:
    wide = (gaussians.means, gaussians.quats, gaussians.scales, gaussians.colors)
    is_finite = torch.isfinite(gaussians.opacities) & (gaussians.quats != 0).any(1)
    for tensor in wide:
        is_finite &= torch.isfinite(tensor).all(1)
    return is_finite


class _Mean:
    """Weighted sums of Gaussians, which come frame by frame, the nearest first."""

    def __init__(self, n: int, device: torch.device) -> None:
        self._weights = torch.zeros(n, dtype=torch.float64, device=device)
        self._sums = torch.zeros(n, 14, dtype=torch.float64, device=device)
        self._facing = torch.zeros(n, 4, dtype=torch.float64, device=device)  # as in the frame that came first
        self._all = 0.0

    def add(self, weight: float, found: Gaussians, place: Tensor) -> None:
        """A frame. place: Where each Gaussian of it belongs. [n] int64"""
        self._all += weight
        quats = torch.nn.functional.normalize(found.quats.double(), dim=1)
        facing = self._facing[place]
        is_new = (facing == 0).all(1)
        facing[is_new] = quats[is_new]
        self._facing[place] = facing
        quats = torch.where((quats * facing).sum(1, keepdim=True) < 0, -quats, quats)
        log_scales = found.scales.double().clamp_min(SMALLEST_SCALE).log()
        opacities = found.opacities.double()[:, None]
        values = torch.cat([found.means.double(), quats, log_scales, opacities, found.colors.double()], dim=1)
        self._sums[place] += weight * values
        self._weights[place] += weight

    def result(self, dtype: torch.dtype) -> tuple[Gaussians, Tensor]:
        """The means, and which of all existed in any frame. [n] bool"""
        is_known = self._weights > 0.0
        sums, weights = self._sums[is_known], self._weights[is_known][:, None]
        means, quats, log_scales, opacities, colors = sums.split([3, 4, 3, 1, 3], dim=1)
        is_turned_away = quats.norm(dim=1, keepdim=True) < 1e-9  # opposite turns that weigh the same
        quats = torch.where(is_turned_away, self._facing[is_known], quats)
        columns = (
            means / weights,
            torch.nn.functional.normalize(quats, dim=1),
            (log_scales / weights).exp(),
            (opacities / max(self._all, SMALLEST_SCALE))[:, 0],
            colors / weights,
        )
        return Gaussians(*(column.to(dtype) for column in columns)), is_known
