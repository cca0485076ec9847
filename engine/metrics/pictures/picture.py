"""All figures of one rendered picture against what the camera took, and why a figure is missing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from engine.images.psnr import psnr_of, squared_error
from engine.metrics.columns import COLUMNS
from engine.metrics.pictures import flip
from engine.metrics.pictures.colors import Precision, as_shown, correct_colors, fit_colors
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


@dataclass(frozen=True, slots=True)
class PictureFigures:
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
    is_valid: np.ndarray | None = None,
    metrics: Choice = "all",
    precision: Precision = "float",
) -> PictureFigures:
    """Compare a picture with the truth, where the camera sees anything.

    Where it sees nothing, the truth stands in both pictures, which windows and filters then look at, and no mean is
    taken over it: every figure is one of valid pixels.

    Args:
        image: Rendered, any float type; clamped, and rounded if `precision` says so. [H, W, 3]
        pixels: The camera's own picture. [H, W, 3] uint8
        is_moving: Which pixels move. [H, W] bool
        is_valid: Which pixels the camera sees; None for all. [H, W] bool
        metrics: "quick" is PSNR, SSIM and DSSIM1; "all" is every column, at about twice the time.
        precision: See engine.metrics.pictures.colors.as_shown. The colour fit starts from that picture and is not
        rounded again.
    """
    if not np.isfinite(image).all():
        return _filled({}, "the picture has values that are not finite", metrics, is_moving, image.shape)
    if is_valid is not None and not is_valid.any():
        return _filled({}, "the camera sees nothing of the picture", metrics, is_moving, image.shape)
    truth = pixels.astype(np.float32) / np.float32(255.0)
    shown = _with_truth(as_shown(image, precision), truth, is_valid)
    still = ~is_moving
    if is_valid is not None:
        is_moving, still = is_moving & is_valid, still & is_valid
    truth_seen = flip.seen(truth) if metrics == "all" else None
    found: dict[str, float | None] = {"moving_share": masked_mean(is_moving, is_valid)}
    parts = {"": is_valid, "_moving": is_moving, "_rest": still}
    fitted = np.clip(fit_colors(shown, truth, is_valid), 0.0, 1.0).astype(np.float32)
    fitted = _with_truth(fitted, truth, is_valid)
    found["cc_psnr"] = psnr_of(squared_error(correct_colors(shown, truth, is_valid), truth), is_valid)
    found["psnr_light"] = _psnr_in_same_light(fitted, truth, still, is_valid)
    for fit, picture in (("", shown), ("_fit", fitted)):
        similarity = Similarity.of(picture, truth)
        error, alike = squared_error(picture, truth), ssim_pixels(similarity)
        for part, mask in parts.items():
            found[f"psnr{fit}{part}"] = psnr_of(error, mask)
            found[f"ssim{fit}{part}"] = masked_mean(alike, mask)
        found[f"dssim1{fit}"] = 0.5 * (1.0 - masked_mean(alike, is_valid))
        if truth_seen is None:  # the quick choice
            continue
        found[f"dssim_range2{fit}"] = dssim_range2_of(similarity, is_valid)
        found[f"dssim_ms{fit}"] = dssim_ms_of(picture, truth, similarity, is_valid)
        noticed = flip.flip_of(flip.seen(picture), truth_seen)
        found |= {f"flip{fit}{part}": masked_mean(noticed, mask) for part, mask in parts.items()}
    return _filled(found, None, metrics, is_moving, image.shape)


def _with_truth(picture: np.ndarray, truth: np.ndarray, is_valid: np.ndarray | None) -> np.ndarray:
    return picture if is_valid is None else np.where(is_valid[..., None], picture, truth)


def _psnr_in_same_light(
    fitted: np.ndarray, truth: np.ndarray, is_still: np.ndarray, is_valid: np.ndarray | None
) -> float | None:
    relit = fit_light(fitted, truth, is_still)
    return None if relit is None else psnr_of(squared_error(np.clip(relit, 0.0, 1.0), truth), is_valid)


def _filled(
    found: dict[str, float | None], fault: str | None, metrics: Choice, is_moving: np.ndarray, shape: tuple[int, ...]
) -> PictureFigures:
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
        elif name.startswith("dssim_ms"):
            is_small = min(shape[:2]) < MS_MIN_SIDE_PX
            side = f"a side of {min(shape[:2])} px is below {MS_MIN_SIDE_PX} px"
            missing[name] = side if is_small else "the camera sees too little of the picture"
        else:
            missing[name] = "no moving pixels" if not is_moving.any() else "no pixels that do not move"
    return PictureFigures(figures, missing)
