"""The slow truth of the decode: plain torch in any dtype, gradients by autograd."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.raster.gaussians import Gaussians

if TYPE_CHECKING:
    from engine.model.decoding import ChosenAnchors


def decode_reference(
    chosen: Sequence[ChosenAnchors],
    decoder: Decoder,
    field: SpatioTemporalField | None,
    knots: Sequence[tuple[int, float]],
) -> Gaussians:
    """Arguments are those of `decode_anchors`, already checked. Differentiable in every tensor."""
    k = decoder.gaussians_per_anchor
    parts = []
    for part in chosen:
        rows, anchors = part.rows, part.anchors
        if part.decoded is not None:
            copied = part.decoded[(rows[:, None] * k + torch.arange(k, device=rows.device)).reshape(-1)].detach()
            is_frozen = torch.ones(len(copied), dtype=torch.bool, device=rows.device)
            parts.append(Gaussians(*copied.tensors(), is_frozen=is_frozen))
            continue
        dynamic_features = None
        if part.corners is not None:
            assert field is not None
            dynamic_features = field(rows, part.corners, list(knots))
        parts.append(
            activate(
                decoder.raw(anchors.features.index_select(0, rows), dynamic_features),
                positions=part.places[rows],
                color_logits=anchors.color_logits[rows],
                log_offset_scales=anchors.log_offset_scales.index_select(0, rows),
                log_base_scales=anchors.log_base_scales.index_select(0, rows),
                gaussians_per_anchor=k,
            )
        )
    if not parts:
        zeros = decoder.first["opacity"].new_zeros
        return Gaussians(zeros(0, 3), zeros(0, 4), zeros(0, 3), zeros(0), zeros(0, 3))
    return Gaussians.concatenate(parts)


def join_reference(frozen: Gaussians, rows: Tensor, learning: Gaussians) -> Gaussians:
    """Arguments are those of `join_frozen`, already checked."""
    is_frozen = torch.ones(len(rows), dtype=torch.bool, device=rows.device)
    chosen = Gaussians(*frozen[rows].detach().tensors(), is_frozen=is_frozen)
    return Gaussians.concatenate([chosen, learning])


def activate(
    raw: Tensor,
    *,
    positions: Tensor,
    color_logits: Tensor,
    log_offset_scales: Tensor,
    log_base_scales: Tensor,
    gaussians_per_anchor: int,
) -> Gaussians:
    """Gaussians from head outputs.

    For Gaussian k of an anchor at mu, with raw outputs o, c, (u, q), d:
        opacity = sigmoid(o);  color = sigmoid(c + color_logit);  scale = exp(log_base) * sigmoid(u);
        quat = q (the rasterizer normalises);  mean = mu + d * exp(log_offset).
    Source: ClipGStream, temporal Gaussians; the colour logit of the cloud is our addition.

    Args:
        raw: Opacity K, colour 3K, shape 7K, offset 3K values side by side. [n, 14 K]
        positions, color_logits, log_offset_scales, log_base_scales: As in AnchorSet. [n, 3] each
        gaussians_per_anchor: K.
    Returns:
        n * K Gaussians, anchor-major.
    """
    n, k = len(raw), gaussians_per_anchor
    opacity, color, shape, offset = raw.split([k, 3 * k, 7 * k, 3 * k], dim=1)
    shape = shape.reshape(n, k, 7)
    means = positions[:, None] + offset.reshape(n, k, 3) * log_offset_scales.exp()[:, None]
    scales = log_base_scales.exp()[:, None] * torch.sigmoid(shape[..., :3])
    colors = torch.sigmoid(color.reshape(n, k, 3) + color_logits[:, None])
    return Gaussians(
        means=means.reshape(-1, 3),
        quats=shape[..., 3:].reshape(-1, 4),
        scales=scales.reshape(-1, 3),
        opacities=torch.sigmoid(opacity).reshape(-1),
        colors=colors.reshape(-1, 3),
    )
