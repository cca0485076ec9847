"""All figures of one rendered picture against what the camera took, and why a figure is missing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from engine.images.psnr import psnr_of, squared_error
from engine.metrics.columns import COLUMNS
from engine.metrics.pictures import flip, lpips
from engine.metrics.pictures.colors import Precision, as_shown, fit_colors
from engine.metrics.pictures.light import fit_light
from engine.metrics.pictures.similarity import (
    MS_MIN_SIDE_PX,
    Similarity,
    dssim_ms_of,
    dssim_range2_of,
    masked_mean,
    ssim_pixels,
)

Choice = Literal["quick", "all"]
CHOICES: tuple[Choice, ...] = get_args(Choice)
FIGURES_VERSION = 4
"""Raised when a figure of the same picture changes: kept figures of earlier versions are not mixed with new ones."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Figures of one picture.

    Attributes:
        figures: Every name of COLUMNS; None where the figure does not exist.
        missing: The reason for each None.
    """

    figures: dict[str, float | None]
    missing: dict[str, str]


def measure_picture(
    image: np.ndarray,
    pixels: np.ndarray,
    is_moving: np.ndarray,
    *,
    metrics: Choice = "all",
    precision: Precision = "float",
) -> Measured:
    """Compare a picture with the truth.

    Args:
        image: Rendered, any float type; clamped, and rounded if `precision` says so. [H, W, 3]
        pixels: What the camera took. [H, W, 3] uint8
        is_moving: Which pixels move. [H, W] bool
        metrics: "quick" is PSNR, SSIM and DSSIM1; "all" is every column, at about twice the time.
        precision: See engine.metrics.pictures.colors.as_shown. The colour fit starts from that picture and is not
        rounded again.
    """
    if not np.isfinite(image).all():
        return _filled({}, "the picture has values that are not finite", metrics, is_moving, image.shape)
    truth = pixels.astype(np.float32) / np.float32(255.0)
    shown = as_shown(image, precision)
    truth_seen = flip.seen(truth) if metrics == "all" else None
    found: dict[str, float | None] = {"moving_share": float(is_moving.mean())}
    parts = {"": None, "_moving": is_moving, "_rest": ~is_moving}
    fitted = np.clip(fit_colors(shown, truth), 0.0, 1.0).astype(np.float32)
    found["psnr_light"] = _psnr_in_same_light(fitted, truth, ~is_moving)
    for fit, picture in (("", shown), ("_fit", fitted)):
        similarity = Similarity.of(picture, truth)
        error, alike = squared_error(picture, truth), ssim_pixels(similarity)
        for part, mask in parts.items():
            found[f"psnr{fit}{part}"] = psnr_of(error, mask)
            found[f"ssim{fit}{part}"] = masked_mean(alike, mask)
        found[f"dssim1{fit}"] = 0.5 * (1.0 - masked_mean(alike, None))
        if truth_seen is None:  # the quick choice
            continue
        found[f"dssim_range2{fit}"] = dssim_range2_of(similarity)
        found[f"dssim_ms{fit}"] = dssim_ms_of(picture, truth, similarity)
        noticed = flip.flip_of(flip.seen(picture), truth_seen)
        found |= {f"flip{fit}{part}": masked_mean(noticed, mask) for part, mask in parts.items()}
        found[f"lpips{fit}"] = lpips.lpips(picture, truth)
    if metrics == "all":
        found["lpips_unscaled"] = lpips.lpips_unscaled(shown, truth)
    return _filled(found, None, metrics, is_moving, image.shape)


def _psnr_in_same_light(fitted: np.ndarray, truth: np.ndarray, is_still: np.ndarray) -> float | None:
    relit = fit_light(fitted, truth, is_still)
    return None if relit is None else psnr_of(squared_error(np.clip(relit, 0.0, 1.0), truth))


def _filled(
    found: dict[str, float | None], fault: str | None, metrics: Choice, is_moving: np.ndarray, shape: tuple[int, ...]
) -> Measured:
    """Every column in order, NaN as None, and a reason for each None."""
    figures: dict[str, float | None] = {}
    missing: dict[str, str] = {}
    for name, column in COLUMNS.items():
        value = found.get(name)
        figures[name] = None if value is None or math.isnan(value) else value
        if figures[name] is not None:
            continue
        if metrics == "quick" and not column.is_quick:
            missing[name] = "not measured: the quick choice of metrics"
        elif fault is not None:
            missing[name] = fault
        elif name.startswith("lpips"):
            missing[name] = lpips.why_missing() or "the network gave no finite value"
        elif name.startswith("dssim_ms"):
            missing[name] = f"a side of {min(shape[:2])} px is below {MS_MIN_SIDE_PX} px"
        else:
            missing[name] = "no moving pixels" if not is_moving.any() else "no pixels that do not move"
    return Measured(figures, missing)
