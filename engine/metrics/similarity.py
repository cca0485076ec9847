"""The SSIM family: SSIM, its two DSSIMs by data range, and the DSSIM of MS-SSIM, each under a name of its own.

Papers print "DSSIM" for three different things; here dssim1 is (1 - SSIM) / 2 with data range 1, dssim_range2 the same
with data range 2, dssim_ms (1 - MS-SSIM) / 2. All use the 11 x 11 Gaussian window of sigma 1.5, per channel.
Pictures are [H, W, 3] in 0..1 and are clamped to that first; masks [H, W] bool.
"""

from __future__ import annotations

import math

import numpy as np

from engine.metrics.window import RADIUS, blur_along_rows, similarity_of_rows

K1, K2 = 0.01, 0.03
"""Constants of SSIM, as shares of the data range: C1 = (K1 L)^2, C2 = (K2 L)^2."""
MS_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the five scales of MS-SSIM, finest first. Source: Wang, Simoncelli, Bovik 2003."""
MS_MIN_SIDE_PX = 11 * 2 ** (len(MS_WEIGHTS) - 1)
"""Below this side the coarsest of the five scales is smaller than the window."""


class Moments:
    """Two pictures blurred along x: means, squares and product, shared by all figures of one pair of pictures.

    Attributes:
        rows: Blurred a, b, a^2, b^2, ab with five zero rows above and below. [5, H + 10, 3 W] float32
    """

    def __init__(self, image: np.ndarray, truth: np.ndarray) -> None:
        height, width, _ = image.shape
        self.rows = np.zeros((5, height + 2 * RADIUS, 3 * width), np.float32)
        a, b = (np.clip(p, 0.0, 1.0).astype(np.float32, copy=False) for p in (image, truth))
        a, b = (np.ascontiguousarray(p).reshape(height, 3 * width) for p in (a, b))
        blur_along_rows(a, b, self.rows)

    def maps(self, data_range: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """SSIM, and its contrast-structure factor, of each pixel and channel. Both [H, W, 3] float32"""
        height, width3 = self.rows.shape[1] - 2 * RADIUS, self.rows.shape[2]
        ssim, structure = np.empty((height, width3), np.float32), np.empty((height, width3), np.float32)
        c1, c2 = ((k * data_range) ** 2 for k in (K1, K2))
        similarity_of_rows(self.rows, c1, c2, ssim, structure)
        return ssim.reshape(height, -1, 3), structure.reshape(height, -1, 3)


def ssim_pixels(moments: Moments) -> np.ndarray:
    """SSIM of each pixel, mean over its channels, data range 1. [H, W] float32"""
    return np.einsum("hwc->hw", moments.maps()[0]) / np.float32(3)  # many times faster than mean over a short axis


def ssim(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean SSIM, data range 1, zero padding, all pixels of the picture, as 3D Gaussian splatting computes it.

    With a mask: the mean of the SSIM map over its pixels (windows look over its edge); NaN for an empty one. Border
    pixels count, unlike in scikit-image and torchmetrics, which cut them off or mirror the picture. Checked against
    engine.training.losses.ssim_map, and inside the border against scikit-image and torchmetrics.
    """
    return masked_mean(ssim_pixels(Moments(image, truth)), mask)


def dssim1(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - SSIM) / 2 with SSIM as in `ssim`: data range 1."""
    return 0.5 * (1.0 - ssim(image, truth))


def dssim_range2(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - SSIM) / 2 with the constants of data range 2 for pictures in 0..1, otherwise as in `ssim`.

    Smaller than dssim1 for the same pictures. Source: SpacetimeGaussians' tables, which use pictures in 0..1 with the
    range of -1..1. Checked against scikit-image and torchmetrics inside the border.
    """
    return dssim_range2_of(Moments(image, truth))


def dssim_range2_of(moments: Moments) -> float:
    """`dssim_range2` from moments that are there already."""
    return 0.5 * (1.0 - float(moments.maps(2.0)[0].mean(dtype=np.float64)))


def dssim_ms(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - MS-SSIM) / 2, data range 1; NaN where a side is below MS_MIN_SIDE_PX (176).

    Five scales by 2 x 2 means, exponents MS_WEIGHTS; contrast-structure of the four fine scales, over the windows that
    lie inside the picture, and SSIM of the coarsest, the picture mirrored at its border; both averaged over channels,
    negative averages count as zero. Source: Wang, Simoncelli, Bovik 2003, in the form of torchmetrics, which
    ClipGStream's figures come from; checked against torchmetrics.
    """
    return dssim_ms_of(image, truth, Moments(image, truth))


def dssim_ms_of(image: np.ndarray, truth: np.ndarray, moments: Moments) -> float:
    """`dssim_ms` with the moments of the finest scale given."""
    if min(image.shape[:2]) < MS_MIN_SIDE_PX:
        return math.nan
    a, b = (np.clip(p, 0.0, 1.0).astype(np.float32, copy=False) for p in (image, truth))
    product = 1.0
    inside = slice(RADIUS, -RADIUS)
    for scale, weight in enumerate(MS_WEIGHTS):
        is_coarsest = scale == len(MS_WEIGHTS) - 1
        if scale:
            a, b = _halve(a), _halve(b)
            moments = Moments(_mirrored(a), _mirrored(b)) if is_coarsest else Moments(a, b)
        ssim_map, structure = moments.maps()
        factor = (ssim_map if is_coarsest else structure)[inside, inside]
        product *= max(float(factor.mean(dtype=np.float64)), 0.0) ** weight
    return 0.5 * (1.0 - product)


def _mirrored(image: np.ndarray) -> np.ndarray:
    """The picture continued over its border by as much as a window reaches. [H + 10, W + 10, 3]"""
    return np.pad(image, ((RADIUS, RADIUS), (RADIUS, RADIUS), (0, 0)), mode="reflect")


def masked_mean(values: np.ndarray, mask: np.ndarray | None) -> float:
    """Mean over the pixels of a mask, or over all; NaN for an empty one."""
    chosen = values if mask is None else values[mask]
    return float(chosen.mean(dtype=np.float64)) if chosen.size else math.nan


def _halve(image: np.ndarray) -> np.ndarray:
    """Means of 2 x 2 pixels; an odd last row or column is left out. [H // 2, W // 2, 3]"""
    height, width = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
    top, bottom = image[0:height:2], image[1:height:2]
    total = top[:, 0:width:2] + top[:, 1:width:2] + bottom[:, 0:width:2] + bottom[:, 1:width:2]
    return total * np.float32(0.25)
