"""Head outputs to Gaussians: the activations of the decoder, one op with two back ends.

For Gaussian k of an anchor at mu, with raw outputs o, c, (u, q), d:
    opacity = sigmoid(o);  color = sigmoid(c + color_logit);  scale = exp(log_base) * sigmoid(u);
    quat = q (the rasterizer normalises);  mean = mu + d * exp(log_offset).
Source: ClipGStream, temporal Gaussians; the colour logit of the cloud is our addition.

"reference" is plain torch in any dtype and differentiable in everything. "fused" is one numba pass each way for
float32, without gradient for positions and colour logits, which never learn. "auto" picks fused where it applies.
"""

from __future__ import annotations

import numpy as np
import torch
from numba import njit, prange
from torch import Tensor

from engine.model.fast_exp import exp_float32
from engine.raster.gaussians import Gaussians

_ONE = np.float32(1)
_ZERO = np.float32(0)


def activate(
    raw: Tensor,
    *,
    positions: Tensor,
    color_logits: Tensor,
    log_offset_scales: Tensor,
    log_base_scales: Tensor,
    gaussians_per_anchor: int,
    backend: str = "auto",
) -> Gaussians:
    """Gaussians from head outputs.

    Args:
        raw: Opacity K, colour 3K, shape 7K, offset 3K values side by side. [n, 14 K]
        positions, color_logits, log_offset_scales, log_base_scales: As in AnchorSet. [n, 3] each
        gaussians_per_anchor: K.
        backend: "auto", "fused" or "reference".
    Returns:
        n * K Gaussians, anchor-major. Differentiable in raw and both scales; "reference" in everything.
    """
    if backend == "auto":
        needs_reference = raw.dtype != torch.float32 or positions.requires_grad or color_logits.requires_grad
        backend = "reference" if needs_reference else "fused"
    return _BACKENDS[backend](raw, positions, color_logits, log_offset_scales, log_base_scales, gaussians_per_anchor)


def _activate_reference(
    raw: Tensor, positions: Tensor, color_logits: Tensor, log_offset: Tensor, log_base: Tensor, k: int
) -> Gaussians:
    n = len(raw)
    opacity, color, shape, offset = raw.split([k, 3 * k, 7 * k, 3 * k], dim=1)
    shape = shape.reshape(n, k, 7)
    means = positions[:, None] + offset.reshape(n, k, 3) * log_offset.exp()[:, None]
    scales = log_base.exp()[:, None] * torch.sigmoid(shape[..., :3])
    colors = torch.sigmoid(color.reshape(n, k, 3) + color_logits[:, None])
    return Gaussians(
        means=means.reshape(-1, 3),
        quats=shape[..., 3:].reshape(-1, 4),
        scales=scales.reshape(-1, 3),
        opacities=torch.sigmoid(opacity).reshape(-1),
        colors=colors.reshape(-1, 3),
    )


@njit(parallel=True, cache=True, nogil=True, error_model="numpy")
def _forward(raw, positions, color_logits, log_offset, log_base, k, means, quats, scales, opacities, colors):
    n_values = raw.shape[1]
    for i in prange(raw.shape[0]):
        sigmoid = np.empty(n_values, np.float32)
        for v in range(n_values):
            sigmoid[v] = raw[i, v]
        for v in range(3 * k):
            sigmoid[k + v] += color_logits[i, v % 3]
        for v in range(n_values):  # one straight loop over all values, so that it vectorises; some are not used
            sigmoid[v] = _ONE / (_ONE + exp_float32(-sigmoid[v]))
        for g in range(k):
            row = i * k + g
            shape = 4 * k + 7 * g
            opacities[row] = sigmoid[g]
            for axis in range(3):
                colors[row, axis] = sigmoid[k + 3 * g + axis]
                scales[row, axis] = exp_float32(log_base[i, axis]) * sigmoid[shape + axis]
                step = exp_float32(log_offset[i, axis])
                means[row, axis] = positions[i, axis] + raw[i, 11 * k + 3 * g + axis] * step
            for axis in range(4):
                quats[row, axis] = raw[i, shape + 3 + axis]


@njit(parallel=True, cache=True, nogil=True, error_model="numpy")
def _backward(
    raw,
    log_offset,
    log_base,
    k,
    scales,
    opacities,
    colors,
    d_means,
    d_quats,
    d_scales,
    d_opacities,
    d_colors,
    d_raw,
    d_log_offset,
    d_log_base,
):
    for i in prange(raw.shape[0]):
        for axis in range(3):
            step = exp_float32(log_offset[i, axis])
            inverse_base = exp_float32(-log_base[i, axis])
            offset_sum, base_sum = _ZERO, _ZERO
            for g in range(k):
                row = i * k + g
                scale, d_scale = scales[row, axis], d_scales[row, axis]
                d_mean = d_means[row, axis]
                color = colors[row, axis]
                # d sigmoid(u) = s (1 - s), and scale = base * s
                d_raw[i, 4 * k + 7 * g + axis] = d_scale * scale * (_ONE - scale * inverse_base)
                base_sum += d_scale * scale
                d_raw[i, 11 * k + 3 * g + axis] = d_mean * step
                offset_sum += d_mean * step * raw[i, 11 * k + 3 * g + axis]
                d_raw[i, k + 3 * g + axis] = d_colors[row, axis] * color * (_ONE - color)
            d_log_offset[i, axis] = offset_sum
            d_log_base[i, axis] = base_sum
        for g in range(k):
            row = i * k + g
            opacity = opacities[row]
            d_raw[i, g] = d_opacities[row] * opacity * (_ONE - opacity)
            for axis in range(4):
                d_raw[i, 4 * k + 7 * g + 3 + axis] = d_quats[row, axis]


class _Fused(torch.autograd.Function):
    @staticmethod
    def forward(ctx, raw, positions, color_logits, log_offset, log_base, k):
        raw, log_offset, log_base = (t.detach().contiguous() for t in (raw, log_offset, log_base))
        rows = len(raw) * k
        means, quats, scales = torch.empty(rows, 3), torch.empty(rows, 4), torch.empty(rows, 3)
        opacities, colors = torch.empty(rows), torch.empty(rows, 3)
        fixed = (positions.contiguous().numpy(), color_logits.contiguous().numpy())
        outputs = (means, quats, scales, opacities, colors)
        _forward(raw.numpy(), *fixed, log_offset.numpy(), log_base.numpy(), k, *(t.numpy() for t in outputs))
        ctx.save_for_backward(raw, log_offset, log_base, scales, opacities, colors)
        ctx.k = k
        return outputs

    @staticmethod
    def backward(ctx, *gradients):
        raw, log_offset, log_base, scales, opacities, colors = ctx.saved_tensors
        d_raw, d_log_offset, d_log_base = (torch.empty_like(t) for t in (raw, log_offset, log_base))
        inputs = (raw, log_offset, log_base)
        _backward(
            *(t.numpy() for t in inputs),
            ctx.k,  # pyright: ignore[reportCallIssue] - sees no lengths
            *(t.numpy() for t in (scales, opacities, colors)),
            *(gradient.contiguous().numpy() for gradient in gradients),
            *(t.numpy() for t in (d_raw, d_log_offset, d_log_base)),
        )
        return d_raw, None, None, d_log_offset, d_log_base, None


def _activate_fused(
    raw: Tensor, positions: Tensor, color_logits: Tensor, log_offset: Tensor, log_base: Tensor, k: int
) -> Gaussians:
    return Gaussians(*_Fused.apply(raw, positions, color_logits, log_offset, log_base, k))  # type: ignore[misc]


_BACKENDS = {"reference": _activate_reference, "fused": _activate_fused}
