"""The photometric loss by one fused pass, and its place in autograd."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from engine.backends.backend import PhotometricLoss
from engine.backends.cpu.step.fused_loss import LossTerms, LossWorkspace, loss_terms

_N_IDLE = 4
_IDLE: deque[LossWorkspace] = deque(maxlen=_N_IDLE)
"""Scratch that nobody uses at the moment, of any size. deque operations are atomic."""


def photometric_loss_cpu(
    image: Tensor,
    truth: Tensor,
    *,
    ssim_weight: float,
    gain: Tensor | None,
    is_counted: Tensor | None,
    tile_mask: Tensor | None,
    rest: Tensor | None,
) -> PhotometricLoss:
    """Arguments are those of `photometric_loss`, already checked; float32 on the cpu."""
    mean_square = 0.0

    def compute(image: Tensor, gain: Tensor | None) -> tuple[LossTerms, float]:
        nonlocal mean_square
        workspace = _take(*image.shape[:2])
        terms = loss_terms(
            image.contiguous().numpy(),
            truth.detach().contiguous().numpy(),
            ssim_weight=ssim_weight,
            gain=None if gain is None else gain.contiguous().numpy(),
            is_counted=None if is_counted is None else is_counted.contiguous().numpy(),
            tile_mask=None if tile_mask is None else tile_mask.contiguous().numpy(),
            rest=None if rest is None else rest.detach().contiguous().numpy(),
            workspace=workspace,
        )
        _IDLE.append(workspace)
        n = image.numel()
        mean_square = terms.square / n
        return terms, ((1 - ssim_weight) * terms.l1 + ssim_weight * terms.dissimilarity) / n

    loss = _Photometric.apply(image, gain, compute)
    squares = torch.tensor(mean_square, dtype=torch.float64)
    return PhotometricLoss(loss, squares)  # pyright: ignore[reportArgumentType] - apply is untyped


def _take(height: int, width: int) -> LossWorkspace:
    """Idle scratch of this picture size, or fresh one."""
    for _ in range(len(_IDLE)):
        try:
            workspace = _IDLE.pop()
        except IndexError:  # another thread was faster
            break
        if (workspace.height, workspace.width) == (height, width):
            return workspace
        _IDLE.appendleft(workspace)
    return LossWorkspace(height, width)


class _Photometric(torch.autograd.Function):
    @staticmethod
    def forward(ctx, image: Tensor, gain: Tensor | None, compute: Callable):
        terms, value = compute(image.detach(), None if gain is None else gain.detach())
        ctx.gradient, ctx.gain_gradient = terms.gradient, terms.gain_gradient
        return torch.tensor(value, dtype=torch.float32)

    @staticmethod
    def backward(ctx, *gradients: Tensor):
        scale = float(gradients[0])
        image_grad = gain_grad = None
        if ctx.needs_input_grad[0]:
            image_grad = ctx.gradient if scale == 1.0 else ctx.gradient * scale
        if ctx.needs_input_grad[1]:
            gain_grad = torch.from_numpy((ctx.gain_gradient * scale).astype(np.float32))
        return image_grad, gain_grad, None
