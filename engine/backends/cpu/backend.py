"""CpuBackend: the compiled kernels, behind the operations of a back end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from engine.backends.backend import PhotometricLoss
from engine.backends.cpu.decode.decode import decode_cpu
from engine.backends.cpu.decode.joining import join_cpu
from engine.backends.cpu.raster.rasterize import rasterize_cpu
from engine.backends.cpu.raster.tile_boxes import CpuTileBoxes, tile_boxes_cpu
from engine.backends.cpu.step.adam import CpuAdam
from engine.backends.cpu.step.photometric import photometric_loss_cpu
from engine.backends.cpu.step.tile_squares import tile_squares_cpu
from engine.backends.cpu.step.volume import volume_sum_cpu
from engine.backends.phase import PhasePlan
from engine.kernels.compile_ahead import load_groups_of_cpu
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView
from engine.raster.rendering import Rendering

if TYPE_CHECKING:
    from engine.model.decoding import ChosenAnchors


class CpuBackend:
    """float32 in main memory. See engine.backends.backend.Backend."""

    name = "cpu"
    device = torch.device("cpu")
    dtype = torch.float32

    def is_available(self) -> bool:
        """See Backend. Wherever the program runs: point clouds need the same compiler."""
        return True

    def warm_up(self, *, is_training: bool) -> None:
        """See Backend."""
        load_groups_of_cpu(is_training=is_training)

    def rasterize(
        self,
        gaussians: Gaussians,
        views: list[PinholeView],
        background: Tensor,
        *,
        tile_mask: Tensor | None,
        want_means2d: bool,
        want_depth: bool,
    ) -> Rendering:
        """See Backend."""
        _require_float32("means", gaussians.means)
        return rasterize_cpu(
            gaussians, views, background, tile_mask=tile_mask, want_means2d=want_means2d, want_depth=want_depth
        )

    def tile_boxes(self, gaussians: Gaussians, view: PinholeView) -> CpuTileBoxes:
        """See Backend."""
        _require_float32("means", gaussians.means)
        return tile_boxes_cpu(gaussians, view)

    def decode(
        self,
        chosen: Sequence[ChosenAnchors],
        decoder: Decoder,
        field: SpatioTemporalField | None,
        knots: Sequence[tuple[int, float]],
    ) -> Gaussians:
        """See Backend. Without gradient for colour logits, which never learn."""
        gaussians = decode_cpu(chosen, decoder, field, knots)
        if torch.is_grad_enabled() and any(part.places.requires_grad for part in chosen):
            return replace(gaussians, means=_with_positions(gaussians.means, chosen, decoder.gaussians_per_anchor))
        return gaussians

    def join(self, frozen: Gaussians, rows: Tensor, learning: Gaussians) -> Gaussians:
        """See Backend."""
        return join_cpu(frozen, rows, learning)

    def photometric_loss(
        self,
        image: Tensor,
        truth: Tensor,
        *,
        ssim_weight: float,
        gain: Tensor | None,
        is_counted: Tensor | None,
        tile_mask: Tensor | None,
        rest: Tensor | None,
    ) -> PhotometricLoss:
        """See Backend."""
        _require_float32("image", image)
        return photometric_loss_cpu(
            image,
            truth,
            ssim_weight=ssim_weight,
            gain=gain,
            is_counted=is_counted,
            tile_mask=tile_mask,
            rest=rest,
        )

    def tile_squares(self, image: Tensor, truth: Tensor, gain: Tensor) -> Tensor:
        """See Backend."""
        _require_float32("image", image)
        return tile_squares_cpu(image, truth, gain)

    def volume_sum(self, scales: Tensor, unit: float) -> Tensor:
        """See Backend."""
        return volume_sum_cpu(scales, unit)

    def adam(self, parameters: Mapping[str, Tensor]) -> CpuAdam:
        """See Backend.

        Raises:
            TypeError: A parameter is not contiguous float32 on the cpu.
        """
        return CpuAdam(parameters)

    def phase(self, plan: PhasePlan) -> None:
        """See Backend. The host is where it computes, so nothing is gained by another way."""


def _with_positions(means: Tensor, chosen: Sequence[ChosenAnchors], k: int) -> Tensor:
    """The same means, through which a gradient reaches the positions: a mean is a position and an offset."""
    steps = []
    for part in chosen:
        positions = part.places
        steps.append((positions - positions.detach()).index_select(0, part.rows).repeat_interleave(k, 0))
    return means + torch.cat(steps)


def _require_float32(name: str, tensor: Tensor) -> None:
    if tensor.dtype != torch.float32 or tensor.device.type != "cpu":
        raise TypeError(
            f"back end 'cpu' needs float32 tensors on the cpu, got {name} {tensor.dtype} on {tensor.device}"
        )
