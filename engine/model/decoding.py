"""Anchors to Gaussians: grid -> field network -> four heads -> activations, one call for all sets of a clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.argument_checks import require_tensor
from engine.model.anchors import AnchorSet
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.model.grid import CornerTable
from engine.model.model_backend import ModelBackend
from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True)
class ChosenAnchors:
    """The rows of one anchor set that are to be decoded.

    Attributes:
        anchors: The set.
        rows: Rows of it, each at most once. [n] int64
        corners: Interpolation constants of all its anchors, or None for f_d = 0.
        decoded: Gaussians of all its anchors when they never change; only copied then, and frozen.
        moved: Where all its anchors are at the time that is decoded, if they travel; None where they stay. [A, 3]
    """

    anchors: AnchorSet
    rows: Tensor
    corners: CornerTable | None = None
    decoded: Gaussians | None = None
    moved: Tensor | None = None

    @property
    def places(self) -> Tensor:
        """Where the anchors are, scene units. [A, 3]"""
        return self.anchors.positions if self.moved is None else self.moved


def decode_anchors(
    chosen: Sequence[ChosenAnchors],
    decoder: Decoder,
    field: SpatioTemporalField | None,
    knots: Sequence[tuple[int, float]],
    *,
    backend: ModelBackend,
) -> Gaussians:
    """Decode anchors of several sets into one set of Gaussians.

    Args:
        chosen: Sets with their rows.
        decoder: Heads.
        field: Field of the clip; None only if no set has corners.
        knots: Frames of the clip and their weights, one or two, from `ClipModel.knots`.
        backend: The backend that decodes, from engine.backends.
    Returns:
        K Gaussians per row, anchor-major, sets in order; rows of sets with `decoded` are frozen. Differentiable in
        features, log scales, places, heads and field wherever these require a gradient.
    Raises:
        ValueError: Rows out of range or given twice, or tensors that do not fit together; with both shapes.
        TypeError: A tensor without numbers, or one that the back end cannot work with.
    """
    for part in chosen:
        _check(part, decoder, field)
    return backend.decode(chosen, decoder, field, knots)


def _check(part: ChosenAnchors, decoder: Decoder, field: SpatioTemporalField | None) -> None:
    n_anchors = len(part.anchors)
    rows = part.rows
    require_tensor("rows", rows)
    features = part.anchors.features
    require_tensor("features", features)
    if rows.ndim != 1 or rows.dtype != torch.int64 or rows.device != features.device:
        raise ValueError(
            f"rows must be int64 [n] on {features.device} like the features, "
            f"got {rows.dtype} of shape {list(rows.shape)} on {rows.device}"
        )
    if rows.device.type == "cpu":  # elsewhere a check would wait for the device, which has its own
        _check_values(rows.numpy(), n_anchors)
    if features.shape != (n_anchors, decoder.static_dim):
        wanted = [n_anchors, decoder.static_dim]
        raise ValueError(f"features must be {wanted} for this decoder, got {list(features.shape)}")
    if part.decoded is not None:
        n_gaussians = n_anchors * decoder.gaussians_per_anchor
        for name, width in (("means", (3,)), ("quats", (4,)), ("scales", (3,)), ("opacities", ()), ("colors", (3,))):
            shape = getattr(part.decoded, name).shape
            if shape != (n_gaussians, *width):
                wanted = [n_gaussians, *width]
                raise ValueError(f"{name} of decoded must be {wanted} for {n_anchors} anchors, got {list(shape)}")
    if part.places.shape != (n_anchors, 3):
        raise ValueError(f"moved must be [{n_anchors}, 3] for these anchors, got {list(part.places.shape)}")
    corners = part.corners
    if corners is None:
        return
    if field is None:
        raise ValueError("an anchor set has corners, but there is no field")
    wanted = (n_anchors, len(field.shape.cells), 8)
    for name, shape in (("indices", corners.indices.shape), ("weights", corners.weights.shape)):
        if shape != wanted:
            raise ValueError(f"{name} of corners must be {list(wanted)} for these anchors and field, got {list(shape)}")
    if corners.n_entries != field.shape.n_entries:
        raise ValueError(f"corners are of {corners.n_entries} entries, the field has {field.shape.n_entries}")
    if field.shape.feature_dim != decoder.dynamic_dim:
        raise ValueError(
            f"the field gives [n, {field.shape.feature_dim}], the decoder takes [n, {decoder.dynamic_dim}]"
        )


def _check_values(rows: np.ndarray, n_anchors: int) -> None:
    """By numpy, which takes a tenth of torch's time to check a few thousand numbers."""
    if len(rows) == 0 or (rows[0] >= 0 and rows[-1] < n_anchors and (rows[1:] > rows[:-1]).all()):
        return
    if rows.min() < 0 or rows.max() >= n_anchors:  # the usual case is over; these may be good as well
        raise ValueError(f"rows must lie in 0..{n_anchors - 1}, got {rows.min()}..{rows.max()}")
    n_different = len(np.unique(rows))
    if n_different != len(rows):
        raise ValueError(f"rows must differ from each other, got {n_different} different of {len(rows)}")
