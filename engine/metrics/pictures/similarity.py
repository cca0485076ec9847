"""The SSIM family: SSIM, its two DSSIMs by data range, and the DSSIM of MS-SSIM, each under a name of its own.

Papers print "DSSIM" for three different things; here dssim1 is (1 - SSIM) / 2 with data range 1, dssim_range2 the same
with data range 2, dssim_ms (1 - MS-SSIM) / 2. All use the 11 x 11 Gaussian window of sigma 1.5, per channel.
Pictures are [H, W, 3] in 0..1 and are clamped to that first; masks [H, W] bool.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from engine.metrics.pictures.ssim_window import RADIUS, similarity_maps

MS_WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the five scales of MS-SSIM, finest first. Source: Wang, Simoncelli, Bovik 2003."""
MS_MIN_SIDE_PX = 11 * 2 ** (len(MS_WEIGHTS) - 1)
"""Below this side the coarsest of the five scales is smaller than the window."""


class Similarity(NamedTuple):
    """The terms that all figures of one pair of pictures share, of each pixel and channel. All [H, W, 3] float32

    Attributes:
        ssim: SSIM with data range 1.
        structure: Its contrast-structure factor.
        ssim_range2: SSIM with data range 2.
    """

    ssim: np.ndarray
    structure: np.ndarray
    ssim_range2: np.ndarray

    @classmethod
    def of(cls, image: np.ndarray, truth: np.ndarray) -> Similarity:
        """Compare two pictures; zeros beyond their edge."""
        height, width, _ = image.shape
        a, b = (np.clip(p, 0.0, 1.0).astype(np.float32, copy=False) for p in (image, truth))
        maps = similarity_maps(a, b)
        return cls(*(values.reshape(height, width, 3) for values in maps))


def ssim_pixels(similarity: Similarity) -> np.ndarray:
    """SSIM of each pixel, mean over its channels, data range 1. [H, W] float32"""
    return np.einsum("hwc->hw", similarity.ssim) / np.float32(3)  # many times faster than mean over a short axis


def ssim(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean SSIM, data range 1, zero padding, all pixels of the picture, as 3D Gaussian splatting computes it.

    With a mask: the mean of the SSIM map over its pixels (windows look over its edge); NaN for an empty one. Border
    pixels count, unlike in scikit-image and torchmetrics, which cut them off or mirror the picture. Checked against
    engine.training.step.losses.ssim_map, and inside the border against scikit-image and torchmetrics.
    """
    return masked_mean(ssim_pixels(Similarity.of(image, truth)), mask)


def dssim1(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - SSIM) / 2 with SSIM as in `ssim`: data range 1."""
    return 0.5 * (1.0 - ssim(image, truth))


def dssim_range2(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - SSIM) / 2 with the constants of data range 2 for pictures in 0..1, otherwise as in `ssim`.

    Smaller than dssim1 for the same pictures. Source: SpacetimeGaussians' tables, which use pictures in 0..1 with the
    range of -1..1. Checked against scikit-image and torchmetrics inside the border.
    """
    return dssim_range2_of(Similarity.of(image, truth))


def dssim_range2_of(similarity: Similarity, mask: np.ndarray | None = None) -> float:
    """`dssim_range2` from maps that are there already, of the pixels of a mask; NaN for an empty one."""
    return 0.5 * (1.0 - masked_mean(similarity.ssim_range2, mask))


def dssim_ms(image: np.ndarray, truth: np.ndarray) -> float:
    """(1 - MS-SSIM) / 2, data range 1; NaN where a side is below MS_MIN_SIDE_PX (176).

    Five scales by 2 x 2 means, exponents MS_WEIGHTS; contrast-structure of the four fine scales, over the windows that
    lie inside the picture, and SSIM of the coarsest, the picture mirrored at its border; both averaged over channels,
    negative averages count as zero. Source: Wang, Simoncelli, Bovik 2003, in the form of torchmetrics, which
    ClipGStream's figures come from; checked against torchmetrics.
    """
    return dssim_ms_of(image, truth, Similarity.of(image, truth))


def dssim_ms_of(image: np.ndarray, truth: np.ndarray, similarity: Similarity, mask: np.ndarray | None = None) -> float:
    """`dssim_ms` with the maps of the finest scale given.

    With a mask: means over its pixels, at each scale over those that are made of its pixels alone (windows look over
    its edge); NaN where none is left at the coarsest.
    """
    if min(image.shape[:2]) < MS_MIN_SIDE_PX:
        return math.nan
    a, b = (np.clip(p, 0.0, 1.0).astype(np.float32, copy=False) for p in (image, truth))
    product = 1.0
    inside = slice(RADIUS, -RADIUS)
    for scale, weight in enumerate(MS_WEIGHTS):
        is_coarsest = scale == len(MS_WEIGHTS) - 1
        if scale:
            a, b = _halve(a), _halve(b)
            mask = None if mask is None else _halve(mask[..., None].astype(np.float32))[..., 0] == 1.0
            similarity = Similarity.of(_mirrored(a), _mirrored(b)) if is_coarsest else Similarity.of(a, b)
        factor = (similarity.ssim if is_coarsest else similarity.structure)[inside, inside]
        is_used = mask if mask is None or is_coarsest else mask[inside, inside]
        mean = masked_mean(factor, is_used)
        if math.isnan(mean):
            return math.nan
        product *= max(mean, 0.0) ** weight
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
