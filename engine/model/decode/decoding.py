"""Anchors to Gaussians: grid -> field network -> four heads -> activations, one op for all sets of a clip.

"reference" is plain torch in any dtype and differentiable in everything (engine.model.decode.reference). "cpu" is
fused numba
for float32 (engine.model.decode.cpu), without gradient for positions and colour logits, which never learn. "auto"
picks cpu where it applies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from engine.argument_checks import require_tensor
from engine.model.anchors import AnchorSet
from engine.model.decode.cpu.backend import decode_cpu
from engine.model.decode.reference import decode_reference
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.model.grid import CornerTable
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
        ValueError: Rows out of range or given twice, or tensors that do not fit together; with both shapes.
        TypeError: A tensor without numbers, or "cpu" with tensors that are not contiguous float32 on the cpu.
    """
    for part in chosen:
        _check(part, decoder, field)
    if backend == "auto":
        backend = "cpu" if all(_is_for_cpu(part) for part in chosen) and _is_float32(decoder, field) else "reference"
    if backend not in _BACKENDS:
        raise ValueError(f"backend must be auto or one of {', '.join(sorted(_BACKENDS))}, got {backend!r}")
    if backend == "cpu":
        _require_float32(chosen, decoder, field)
    return _BACKENDS[backend](chosen, decoder, field, knots)


def _check(part: ChosenAnchors, decoder: Decoder, field: SpatioTemporalField | None) -> None:
    n_anchors = len(part.anchors)
    rows = part.rows
    require_tensor("rows", rows)
    if rows.ndim != 1 or rows.dtype != torch.int64 or rows.device.type != "cpu":
        raise ValueError(
            f"rows must be int64 [n] on the cpu, got {rows.dtype} of shape {list(rows.shape)} on {rows.device}"
        )
    values = rows.numpy()  # numpy takes a tenth of torch's time for a look at a few thousand numbers
    is_ascending = len(values) == 0 or (values[0] >= 0 and values[-1] < n_anchors and (values[1:] > values[:-1]).all())
    if not is_ascending:  # the usual case is over; these may be good as well
        if values.min() < 0 or values.max() >= n_anchors:
            raise ValueError(f"rows must lie in 0..{n_anchors - 1}, got {values.min()}..{values.max()}")
        n_different = len(np.unique(values))
        if n_different != len(values):
            raise ValueError(f"rows must differ from each other, got {n_different} different of {len(values)}")
    features = part.anchors.features
    require_tensor("features", features)
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


def _require_float32(chosen: Sequence[ChosenAnchors], decoder: Decoder, field: SpatioTemporalField | None) -> None:
    """TypeError that names a tensor which kernels, who take it by address, would misread."""
    tensors: list[tuple[str, Tensor]] = [("decoder", decoder.first["opacity"])]
    if field is not None:
        tensors.append(("field", field.hidden.weight))
    for part in chosen:
        anchors = part.anchors
        tensors += [
            ("features", anchors.features),
            ("positions", anchors.positions),
            ("color_logits", anchors.color_logits),
            ("log_offset_scales", anchors.log_offset_scales),
            ("log_base_scales", anchors.log_base_scales),
        ]
        if part.decoded is not None:
            tensors += [("decoded", tensor) for tensor in part.decoded.tensors()]
        if not part.rows.is_contiguous():
            raise TypeError("backend 'cpu' needs contiguous rows")
    for name, tensor in tensors:
        if tensor.dtype != torch.float32 or tensor.device.type != "cpu" or not tensor.is_contiguous():
            raise TypeError(
                f"backend 'cpu' needs contiguous float32 tensors on the cpu; {name} is {tensor.dtype} on "
                f"{tensor.device}, {'contiguous' if tensor.is_contiguous() else 'not contiguous'}"
            )


def _is_for_cpu(part: ChosenAnchors) -> bool:
    anchors = part.anchors
    fixed = (anchors.positions, anchors.color_logits)
    features = anchors.features
    is_fit = features.dtype == torch.float32 and features.device.type == "cpu"
    return is_fit and not any(tensor.requires_grad for tensor in fixed)


def _is_float32(decoder: Decoder, field: SpatioTemporalField | None) -> bool:
    weight = decoder.first["opacity"]
    return weight.dtype == torch.float32 and (field is None or field.hidden.weight.dtype == torch.float32)


_BACKENDS = {"reference": decode_reference, "cpu": decode_cpu}
