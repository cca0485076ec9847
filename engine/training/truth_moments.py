"""Moments of a training picture under the window of SSIM, for a truth that is compared with many images.

"fused" reads them instead of blurring the truth again. Training does without: reading two more planes costs more than
it saves. One core, loss and gradient, ms with and without: 320 x 240 1.3 and 1.2, 640 x 360 4.2 and 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from engine.training.fused_loss import blurred_truth


@dataclass(frozen=True, slots=True)
class TruthMoments:
    """Blurred truth and blurred square of one picture.

    Attributes:
        shape: Height and width of the picture, px.
        blurred: In the layout of the kernel, see `engine.training.fused_loss.blurred_truth`. float32
    """

    shape: tuple[int, int]
    blurred: np.ndarray


def truth_moments(truth: Tensor | np.ndarray) -> TruthMoments:
    """Moments of a picture.

    Args:
        truth: float32 in 0..1, or uint8. [H, W, 3]
    Raises:
        ValueError, TypeError: It is no such picture.
    """
    pixels = writable_picture(truth)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise ValueError(f"truth must be [H, W, 3] with at least one pixel, got {list(pixels.shape)}")
    if pixels.dtype not in (np.uint8, np.float32):
        raise TypeError(f"truth must be uint8 or float32, got {pixels.dtype}")
    return TruthMoments((pixels.shape[0], pixels.shape[1]), blurred_truth(pixels))


def writable_picture(truth: Tensor | np.ndarray) -> np.ndarray:
    """As the kernels take it: contiguous and writable; a read-only array would compile them a second time."""
    pixels = truth.detach().numpy() if isinstance(truth, Tensor) else truth
    return np.require(pixels, requirements=["C", "W"])
