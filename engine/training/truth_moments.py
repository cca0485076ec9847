"""Moments of a training picture under the window of SSIM, made once and read at every step that draws the picture.

`TruthMoments` is what "fused" reads instead of blurring the truth again; `MomentCache` keeps those used last.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
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


class MomentCache:
    """Moments of the pictures used last, up to a number of bytes. Owns no picture.

    Args:
        max_bytes: Budget; a picture of 320 x 240 takes 2 MB, one of 640 x 360 takes 6.
    """

    def __init__(self, max_bytes: int = 128 << 20) -> None:
        self.max_bytes = max_bytes
        self.n_bytes = 0
        self._kept: OrderedDict[Hashable, TruthMoments] = OrderedDict()

    def get(self, key: Hashable, truth: Tensor | np.ndarray) -> TruthMoments:
        """Moments of the picture with this key, made from `truth` unless they are there already."""
        known = self._kept.get(key)
        if known is not None:
            self._kept.move_to_end(key)
            return known
        made = truth_moments(truth)
        self._kept[key] = made
        self.n_bytes += made.blurred.nbytes
        while self.n_bytes > self.max_bytes and self._kept:
            _, dropped = self._kept.popitem(last=False)
            self.n_bytes -= dropped.blurred.nbytes
        return made

    def __len__(self) -> int:
        return len(self._kept)
