"""Photometric loss of one picture: (1 - w) L1 + w (1 - SSIM), by any back end.

SSIM as in 3D Gaussian splatting: 11 x 11 Gaussian window of sigma 1.5, zero padding, per channel, mean, constants
0.01^2 and 0.03^2. Checks arguments and hands them on; computes nothing.
"""

from __future__ import annotations

import torch
from torch import Tensor

from engine.argument_checks import require_number, require_tensor
from engine.backends.backend import Backend, PhotometricLoss
from engine.raster.pinhole_view import n_tiles


def photometric_loss(
    image: Tensor,
    truth: Tensor,
    *,
    backend: Backend,
    ssim_weight: float,
    gain: Tensor | None = None,
    is_counted: Tensor | None = None,
    tile_mask: Tensor | None = None,
    rest: Tensor | None = None,
) -> PhotometricLoss:
    """(1 - w) L1 + w (1 - SSIM) of one picture.

    Other pixels are taken as right: where `is_counted` is false or the tile is not active, the truth replaces
    image * gain, whatever the image holds (background, NaN), and no gradient arises. The loss is that of the whole
    picture after this replacement: divided by all its pixels, with SSIM also in the 5 px of a replaced region whose
    windows reach into a counted one. So it equals the full loss where the replaced pixels really are right.

    With `rest`, tiles that are not active hold a picture that cannot change, and it stands there in place of the truth.
    The gradient by the image is that of the loss of both together, in active tiles, because SSIM sees `rest` up to 5 px
    beyond them. The value leaves out terms that depend on rest, truth, gain and mask alone: the losses of two images
    under one mask differ as much as those of the whole pictures.

    Args:
        image: Rendered. [H, W, 3]
        truth: Values in 0..1 of the image's dtype, or uint8, read as value / 255. No gradient. [H, W, 3]
        backend: The backend that compares, from engine.backends.
        ssim_weight: w in 0..1.
        gain: Colour gain of the camera, multiplied onto the image. [3]
        is_counted: Pixels that count; None means all. [H, W] bool
        tile_mask: Active tiles of 32 px, the last ones cut off by the picture; None means all. [rows, columns] bool
        rest: Content of inactive tiles, like the image; None for the truth. No gradient, neither by it nor,
            in its tiles, by the gain. [H, W, 3]
    Returns:
        Loss and mean square error. A NaN or infinity in a pixel that counts makes both NaN or infinite.
    Raises:
        ValueError, TypeError: Shape or dtype of an argument does not fit; the message names it.
    """
    _check(image, truth, gain, is_counted, tile_mask, rest)
    require_number("ssim_weight", ssim_weight)
    if not 0.0 <= ssim_weight <= 1.0:
        raise ValueError(f"ssim_weight must lie in 0..1, got {ssim_weight}")
    return backend.photometric_loss(
        image, truth, ssim_weight=ssim_weight, gain=gain, is_counted=is_counted, tile_mask=tile_mask, rest=rest
    )


def _check(
    image: Tensor,
    truth: Tensor,
    gain: Tensor | None,
    is_counted: Tensor | None,
    tile_mask: Tensor | None,
    rest: Tensor | None,
) -> None:
    require_tensor("image", image)
    if image.ndim != 3 or image.shape[2] != 3 or image.numel() == 0:
        raise ValueError(f"image must be [H, W, 3] with at least one pixel, got {list(image.shape)}")
    if not image.is_floating_point():
        raise TypeError(f"image must be floating point, got {image.dtype}")
    height, width = image.shape[:2]
    floats, flags = (image.dtype,), (torch.bool,)
    expected = [
        ("truth", truth, (height, width, 3), (torch.uint8, image.dtype)),
        ("gain", gain, (3,), floats),
        ("is_counted", is_counted, (height, width), flags),
        ("tile_mask", tile_mask, n_tiles(width, height), flags),
        ("rest", rest, (height, width, 3), floats),
    ]
    for name, value, shape, dtypes in expected:
        if value is None:
            continue
        require_tensor(name, value)
        if tuple(value.shape) != shape:
            raise ValueError(
                f"{name} must be {list(shape)} to match image {list(image.shape)}, got {list(value.shape)}"
            )
        if value.dtype not in dtypes or value.device != image.device:
            raise TypeError(
                f"{name} must be {' or '.join(map(str, dtypes))} on {image.device} like the image, "
                f"got {value.dtype} on {value.device}"
            )
