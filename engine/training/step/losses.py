"""Photometric loss of one picture: (1 - w) L1 + w (1 - SSIM), one op with two back ends.

SSIM as in 3D Gaussian splatting: 11 x 11 Gaussian window of sigma 1.5, zero padding, per channel, mean, constants
0.01^2 and 0.03^2. "fused" is one numba pass for float32 that also gives the gradients; "reference" is plain torch in
any float dtype, differentiable by autograd, the slow truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from engine.argument_checks import require_number, require_tensor
from engine.images.ssim_lanes import C1, C2, RADIUS, WINDOW
from engine.training.step.fused_loss import TILE_PX, LossWorkspace, loss_terms, tile_grid


@dataclass(frozen=True, slots=True)
class PhotometricLoss:
    """Loss of one picture.

    Attributes:
        loss: Scalar, differentiable in image and gain.
        mean_square: Mean of (image * gain - truth)^2 over the whole picture; what does not count adds zero, and so do
            tiles that are not active.
    """

    loss: Tensor
    mean_square: float


def photometric_loss(
    image: Tensor,
    truth: Tensor | np.ndarray,
    *,
    ssim_weight: float,
    gain: Tensor | None = None,
    is_counted: np.ndarray | None = None,
    tile_mask: np.ndarray | None = None,
    rest: Tensor | None = None,
    workspace: LossWorkspace | None = None,
    backend: str = "auto",
) -> PhotometricLoss:
    """(1 - w) L1 + w (1 - SSIM) of one picture.

    What does not count is right: where `is_counted` is false or the tile is not active, the truth stands in the place
    of image * gain, whatever the image holds (background, NaN), and no gradient arises. The loss is that of the whole
    picture after this replacement: divided by all its pixels, with SSIM also in the 5 px of a replaced region whose
    windows reach into a counted one. So it equals the full loss where the replaced pixels really are right.

    With `rest`, tiles that are not active hold a picture that cannot change, and it stands there in place of the truth.
    The gradient by the image is that of the loss of both together, in active tiles, because SSIM sees `rest` up to 5 px
    beyond them. The value leaves out what depends on rest, truth, gain and mask alone: of two images under one mask,
    the losses differ by what the losses of the whole pictures differ by.

    Args:
        image: Rendered. [H, W, 3]
        truth: Values in 0..1 of the image's dtype, or uint8, read as value / 255. No gradient. [H, W, 3]
        ssim_weight: w in 0..1.
        gain: Colour gain of the camera, multiplied onto the image. [3]
        is_counted: Pixels that count; None means all. [H, W] bool
        tile_mask: Active tiles of 32 px, the last ones cut off by the picture; None means all. [rows, columns] bool
        rest: What tiles hold that are not active, like the image; None for the truth. No gradient, neither by it nor,
            in its tiles, by the gain. [H, W, 3]
        workspace: Scratch for this picture size, kept between calls; None makes one.
        backend: "auto", "fused" (float32 on the CPU) or "reference".
    Returns:
        Loss and mean square error. A NaN or infinity in a pixel that counts makes both NaN or infinite.
    Raises:
        ValueError, TypeError: Shape or dtype of an argument does not fit; the message names it.
    """
    _check(image, truth, gain, is_counted, tile_mask, rest, workspace)
    require_number("ssim_weight", ssim_weight)
    if not 0.0 <= ssim_weight <= 1.0:
        raise ValueError(f"ssim_weight must lie in 0..1, got {ssim_weight}")
    if backend == "auto":
        backend = "fused" if image.dtype == torch.float32 and image.device.type == "cpu" else "reference"
    if backend not in _BACKENDS:
        raise ValueError(f"backend must be auto or one of {', '.join(sorted(_BACKENDS))}, got {backend!r}")
    if backend == "fused" and (image.dtype != torch.float32 or image.device.type != "cpu"):
        raise TypeError(f"backend 'fused' needs a float32 image on the cpu, got {image.dtype} on {image.device}")
    return _BACKENDS[backend](image, truth, ssim_weight, gain, is_counted, tile_mask, rest, workspace)


def ssim_map(image: Tensor, truth: Tensor) -> Tensor:
    """SSIM of each pixel and channel, any float dtype, differentiable. [H, W, 3]"""
    window = torch.from_numpy(WINDOW).to(image.dtype)
    stack = torch.stack([image, truth, image * image, truth * truth, image * truth])  # [5, H, W, 3]
    planes = stack.permute(0, 3, 1, 2).reshape(1, 15, *image.shape[:2])  # depthwise: channels stay channels
    along = window.view(1, 1, 1, -1).repeat(15, 1, 1, 1)
    planes = functional.conv2d(planes, along, padding=(0, RADIUS), groups=15)
    planes = functional.conv2d(planes, along.transpose(2, 3), padding=(RADIUS, 0), groups=15)
    mu_a, mu_b, aa, bb, ab = planes.reshape(5, 3, *image.shape[:2])
    numerator = (2 * mu_a * mu_b + C1) * (2 * (ab - mu_a * mu_b) + C2)
    denominator = (mu_a**2 + mu_b**2 + C1) * (aa - mu_a**2 + bb - mu_b**2 + C2)
    return (numerator / denominator).permute(1, 2, 0)


def _reference(image, truth, ssim_weight, gain, is_counted, tile_mask, rest, _workspace) -> PhotometricLoss:
    truth = torch.as_tensor(truth)
    truth = truth.to(image.dtype) / 255 if truth.dtype == torch.uint8 else truth.to(image.dtype)
    shown = image if gain is None else image * gain
    counts = torch.from_numpy(np.ones(image.shape[:2], bool) if is_counted is None else is_counted)[..., None]
    active = torch.ones_like(counts)
    if tile_mask is not None:
        pixels = tile_mask.repeat(TILE_PX, 0).repeat(TILE_PX, 1)
        active = torch.from_numpy(pixels[: image.shape[0], : image.shape[1], None])
    frozen = truth if rest is None else (rest if gain is None else rest * gain).detach()
    shown = torch.where(counts, torch.where(active, shown, frozen), truth)
    l1 = torch.where(active, (shown - truth).abs(), 0).mean()
    loss = (1 - ssim_weight) * l1 + ssim_weight * (1 - ssim_map(shown, truth).mean())
    return PhotometricLoss(loss, float((torch.where(active, shown.detach() - truth, 0) ** 2).mean()))


class _Fused(torch.autograd.Function):
    @staticmethod
    def forward(ctx, image: Tensor, gain: Tensor | None, run: Callable):
        terms, value = run(image.detach(), None if gain is None else gain.detach())
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


def _fused(image, truth, ssim_weight, gain, is_counted, tile_mask, rest, workspace) -> PhotometricLoss:
    height, width = image.shape[:2]
    pixels = _writable_picture(truth)
    scratch = workspace or LossWorkspace(height, width)
    mean_square = 0.0

    def run(image: Tensor, gain: Tensor | None):
        nonlocal mean_square
        terms = loss_terms(
            image.contiguous().numpy(),
            pixels,
            ssim_weight=ssim_weight,
            gain=None if gain is None else gain.contiguous().numpy(),
            is_counted=None if is_counted is None else np.require(is_counted, requirements=["C", "W"]),
            tile_mask=None if tile_mask is None else np.require(tile_mask, requirements=["C", "W"]),
            rest=None if rest is None else rest.detach().contiguous().numpy(),
            workspace=scratch,
        )
        n = image.numel()
        mean_square = terms.square / n
        return terms, ((1 - ssim_weight) * terms.l1 + ssim_weight * terms.dissimilarity) / n

    loss = _Fused.apply(image, gain, run)
    return PhotometricLoss(loss, mean_square)  # pyright: ignore[reportArgumentType] - apply is untyped


def _writable_picture(truth: Tensor | np.ndarray) -> np.ndarray:
    """As the kernel takes it: contiguous and writable."""
    pixels = truth.detach().numpy() if isinstance(truth, Tensor) else truth
    return np.require(pixels, requirements=["C", "W"])


_BACKENDS: dict[str, Callable[..., PhotometricLoss]] = {"reference": _reference, "fused": _fused}


def _check(image, truth, gain, is_counted, tile_mask, rest, workspace) -> None:
    require_tensor("image", image)
    if not isinstance(truth, np.ndarray):
        require_tensor("truth", truth)
    if image.ndim != 3 or image.shape[2] != 3 or image.numel() == 0:
        raise ValueError(f"image must be [H, W, 3] with at least one pixel, got {list(image.shape)}")
    if not image.is_floating_point():
        raise TypeError(f"image must be floating point, got {image.dtype}")
    height, width = image.shape[:2]
    expected = [
        ("truth", truth, (height, width, 3)),
        ("gain", gain, (3,)),
        ("is_counted", is_counted, (height, width)),
        ("tile_mask", tile_mask, tile_grid(height, width)),
        ("rest", rest, (height, width, 3)),
    ]
    for name, value in (("gain", gain), ("rest", rest)):
        if value is not None:
            require_tensor(name, value)
    masks = (("is_counted", is_counted), ("tile_mask", tile_mask))
    for name, value in masks:
        if value is not None and not isinstance(value, np.ndarray):
            raise TypeError(f"{name} must be a numpy array, got {type(value).__name__}")
    for name, value, shape in expected:
        if value is not None and tuple(value.shape) != shape:
            raise ValueError(
                f"{name} must be {list(shape)} to match image {list(image.shape)}, got {list(value.shape)}"
            )
    for name, value in masks:
        if value is not None and value.dtype != np.bool_:
            raise TypeError(f"{name} must be bool, got {value.dtype}")
    kinds = ("torch.uint8", "uint8", str(image.dtype), str(image.dtype).removeprefix("torch."))
    if str(truth.dtype) not in kinds:
        raise TypeError(f"truth must be uint8 or {image.dtype} like the image, got {truth.dtype}")
    for name, value in (("gain", gain), ("rest", rest)):
        if value is not None and (value.dtype != image.dtype or value.device != image.device):
            raise TypeError(
                f"{name} must be {image.dtype} on {image.device} like the image, got {value.dtype} on {value.device}"
            )
    if workspace is not None and (workspace.height, workspace.width) != (height, width):
        size = f"{workspace.width} x {workspace.height}"
        raise ValueError(f"workspace was made for {size}, the image is {width} x {height}")
