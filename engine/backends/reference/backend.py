"""ReferenceBackend: plain torch, behind the operations of a back end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from engine.backends.backend import PhotometricLoss
from engine.backends.phase import PhasePlan
from engine.backends.reference.adam import ReferenceAdam
from engine.backends.reference.decode import decode_reference, join_reference
from engine.backends.reference.loss import photometric_loss_reference, tile_squares_reference, volume_sum_reference
from engine.backends.reference.raster import drawable_rows, pixel_boxes, project, rasterize_reference
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import TILE_PX, PinholeView, n_tiles
from engine.raster.rendering import Rendering
from engine.raster.tile_boxes import TileBoxes

if TYPE_CHECKING:
    from engine.model.decoding import ChosenAnchors


_MAIN_MEMORY = torch.device("cpu")


@dataclass(frozen=True, slots=True)
class ReferenceBackend:
    """Any device and floating dtype, for what is made for it; its operations take tensors of others too.

    Everything is differentiable by autograd. See engine.backends.backend.Backend.
    """

    name: str = "reference"
    device: torch.device = _MAIN_MEMORY
    dtype: torch.dtype = torch.float32

    def is_available(self) -> bool:
        """See Backend."""
        try:
            return torch.ones(2, device=self.device, dtype=self.dtype).sum().item() == 2.0
        except (AssertionError, ImportError, NotImplementedError, RuntimeError):  # torch does not find it
            return False

    def warm_up(self, *, is_training: bool) -> None:
        """See Backend. Nothing is compiled."""

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
        return rasterize_reference(
            gaussians, views, background, tile_mask=tile_mask, want_means2d=want_means2d, want_depth=want_depth
        )

    def tile_boxes(self, gaussians: Gaussians, view: PinholeView) -> TileBoxes:
        """See Backend."""
        return tile_boxes_reference(gaussians, view)

    def decode(
        self,
        chosen: Sequence[ChosenAnchors],
        decoder: Decoder,
        field: SpatioTemporalField | None,
        knots: Sequence[tuple[int, float]],
    ) -> Gaussians:
        """See Backend."""
        return decode_reference(chosen, decoder, field, knots)

    def join(self, frozen: Gaussians, rows: Tensor, learning: Gaussians) -> Gaussians:
        """See Backend."""
        return join_reference(frozen, rows, learning)

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
        return photometric_loss_reference(
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
        return tile_squares_reference(image, truth, gain)

    def volume_sum(self, scales: Tensor, unit: float) -> Tensor:
        """See Backend."""
        return volume_sum_reference(scales, unit)

    def adam(self, parameters: Mapping[str, Tensor]) -> ReferenceAdam:
        """See Backend."""
        return ReferenceAdam(parameters)

    def phase(self, plan: PhasePlan) -> None:
        """See Backend. Its operations are what another way is compared with."""


def tile_boxes_reference(gaussians: Gaussians, view: PinholeView) -> TileBoxes:
    """Boxes of checked Gaussians, any dtype and device."""
    gaussians = gaussians.detach()
    packed = torch.ones(len(gaussians), 2, dtype=torch.int32, device=gaussians.means.device)
    rows = drawable_rows(gaussians, view)
    drawn = gaussians[rows]
    centers, covariances, _ = project(drawn, view)
    first, last, _ = pixel_boxes(centers, covariances, drawn.opacities, view)
    tiles = [(pixels / TILE_PX).floor().to(torch.int32) for pixels in (first, last)]
    packed[rows] = tiles[0] | tiles[1] << 16
    return TileBoxes(packed, n_tiles(view.width, view.height))
