"""Head outputs to Gaussians: the activations of the decoder.

`activate` is the public op; its back ends live in one table. "reference" is plain torch and works in any dtype.

For Gaussian k of an anchor at mu, with raw outputs o, c, (u, q), d:
    opacity = sigmoid(o);  color = sigmoid(c + color_logit);  scale = exp(log_base) * sigmoid(u);
    quat = q (the rasterizer normalises);  mean = mu + d * exp(log_offset).
Source: ClipGStream, temporal Gaussians.
"""

from __future__ import annotations

import torch
from torch import Tensor

from engine.raster.gaussians import Gaussians


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

    Args:
        raw: Opacity K, colour 3K, shape 7K, offset 3K values side by side. [n, 14 K]
        positions, color_logits, log_offset_scales, log_base_scales: As in AnchorSet. [n, 3] each
        gaussians_per_anchor: K.
    Returns:
        n * K Gaussians, anchor-major. Differentiable in everything.
    """
    n, k = len(raw), gaussians_per_anchor
    opacity, color, shape, offset = raw.split([k, 3 * k, 7 * k, 3 * k], dim=1)
    shape = shape.reshape(n, k, 7)
    means = (
        positions[:, None] + offset.reshape(n, k, 3) * log_offset_scales.exp()[:, None]
    )
    scales = log_base_scales.exp()[:, None] * torch.sigmoid(shape[..., :3])
    colors = torch.sigmoid(color.reshape(n, k, 3) + color_logits[:, None])
    return Gaussians(
        means=means.reshape(-1, 3),
        quats=shape[..., 3:].reshape(-1, 4),
        scales=scales.reshape(-1, 3),
        opacities=torch.sigmoid(opacity).reshape(-1),
        colors=colors.reshape(-1, 3),
    )
