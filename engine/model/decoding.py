"""Anchors to Gaussians: grid -> field network -> four heads -> activations, one op for all sets of a clip.

"reference" is plain torch in any dtype and differentiable in everything (engine.model.reference). "cpu" is fused numba
for float32 (engine.model.cpu), without gradient for positions and colour logits, which never learn. "auto" picks cpu
where it applies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.model.anchors import AnchorSet
from engine.model.cpu.backend import decode_cpu
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.model.grid import CornerTable
from engine.model.reference import decode_reference
from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True)
class ChosenAnchors:
    """The rows of one anchor set that are to be decoded.

    Attributes:
        anchors: The set.
        rows: Rows of it, each at most once. [n] int64
        corners: Interpolation constants of all its anchors, or None for f_d = 0.
        decoded: Gaussians of all its anchors when they never change; only copied then, and frozen.
    """

    anchors: AnchorSet
    rows: Tensor
    corners: CornerTable | None = None
    decoded: Gaussians | None = None


def decode_anchors(
    chosen: Sequence[ChosenAnchors],
    decoder: Decoder,
    field: SpatioTemporalField | None,
    knots: Sequence[tuple[int, float]],
    *,
    backend: str = "auto",
) -> Gaussians:
    """Decode anchors of several sets into one set of Gaussians.

    Args:
        chosen: Sets with their rows.
        decoder: Heads.
        field: Field of the clip; None only if no set has corners.
        knots: Frames of the clip and their weights, one or two, from `ClipModel.knots`.
        backend: "auto", "cpu" or "reference".
    Returns:
        K Gaussians per row, anchor-major, sets in order; rows of sets with `decoded` are frozen. Differentiable in
        features, log scales, heads and field wherever these require a gradient.
    Raises:
        ValueError: Rows out of range or given twice, or tensors that do not fit together.
    """
    for part in chosen:
        _check(part, decoder, field)
    if backend == "auto":
        backend = "cpu" if all(_is_for_cpu(part) for part in chosen) and _is_float32(decoder, field) else "reference"
    return _BACKENDS[backend](chosen, decoder, field, knots)


def _check(part: ChosenAnchors, decoder: Decoder, field: SpatioTemporalField | None) -> None:
    n_anchors = len(part.anchors)
    rows = part.rows
    if rows.ndim != 1 or rows.dtype != torch.int64:
        raise ValueError(f"rows must be int64 with one axis, got {rows.dtype} of shape {tuple(rows.shape)}")
    values = rows.numpy()  # numpy takes a tenth of torch's time for a look at a few thousand numbers
    is_ascending = len(values) == 0 or (values[0] >= 0 and values[-1] < n_anchors and (values[1:] > values[:-1]).all())
    if not is_ascending:  # the usual case is over; these may be good as well
        if values.min() < 0 or values.max() >= n_anchors:
            raise ValueError(f"rows must lie in 0..{n_anchors - 1}, got {values.min()}..{values.max()}")
        n_different = len(np.unique(values))
        if n_different != len(values):
            raise ValueError(f"rows must differ from each other, got {n_different} different of {len(values)}")
    n_static = part.anchors.features.shape[1]
    if n_static != decoder.static_dim:
        raise ValueError(f"features have {n_static} columns, the decoder takes {decoder.static_dim}")
    if part.corners is None:
        return
    if field is None:
        raise ValueError("an anchor set has corners, but there is no field")
    shape = field.shape
    if part.corners.indices.shape != (n_anchors, len(shape.cells), 8) or part.corners.n_entries != shape.n_entries:
        raise ValueError(
            f"corners {part.corners.indices.shape} of {part.corners.n_entries} entries do not fit {n_anchors} anchors "
            f"and a field of {len(shape.cells)} levels with {shape.n_entries} entries"
        )
    if shape.feature_dim != decoder.dynamic_dim:
        raise ValueError(f"the field gives {shape.feature_dim} values, the decoder takes {decoder.dynamic_dim}")


def _is_for_cpu(part: ChosenAnchors) -> bool:
    anchors = part.anchors
    fixed = (anchors.positions, anchors.color_logits)
    return anchors.features.dtype == torch.float32 and not any(tensor.requires_grad for tensor in fixed)


def _is_float32(decoder: Decoder, field: SpatioTemporalField | None) -> bool:
    weight = decoder.first["opacity"]
    return weight.dtype == torch.float32 and (field is None or field.hidden.weight.dtype == torch.float32)


_BACKENDS = {"reference": decode_reference, "cpu": decode_cpu}
