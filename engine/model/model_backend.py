"""ModelBackend: the part of a back end that shows a model: decodes anchors, joins Gaussians and draws them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from torch import Tensor

from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.raster.gaussians import Gaussians
from engine.raster.rasterizer import Rasterizer

if TYPE_CHECKING:
    from engine.model.decoding import ChosenAnchors


class ModelBackend(Rasterizer, Protocol):
    """The receiver of the checked arguments of `decode_anchors` and `join_frozen`, which also draws the result."""

    def decode(
        self,
        chosen: Sequence[ChosenAnchors],
        decoder: Decoder,
        field: SpatioTemporalField | None,
        knots: Sequence[tuple[int, float]],
    ) -> Gaussians:
        """K Gaussians per row, see `engine.model.decoding.decode_anchors`."""
        ...

    def join(self, frozen: Gaussians, rows: Tensor, learning: Gaussians) -> Gaussians:
        """Chosen frozen Gaussians, then the others, see `engine.model.joining.join_frozen`."""
        ...
