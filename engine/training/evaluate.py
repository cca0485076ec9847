"""Evaluation of a trained clip: one row per frame and camera, held-out cameras marked, nothing left out.

Raw figures use the scene's mean colours for held-out cameras, because their white balance was never seen; training
cameras use their own gains. Fitted figures allow a least-squares gain and offset per channel and are named so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.background import estimate_background
from engine.cloud.masks import motion_mask
from engine.model.clip_model import ClipModel
from engine.model.clip_state import ClipState
from engine.model.view import REACH_SPACINGS, View, render_model
from engine.training.metrics import fit_colors, psnr, ssim
from engine.training.preparation import spread_frames

_BACKGROUND_FRAMES = 50


@dataclass(frozen=True, slots=True)
class EvalRow:
    """One rendered picture against its truth. PSNR in dB.

    Attributes:
        clip_index, frame_index, camera: Which picture; camera is its name.
        is_held_out: Whether the camera was kept from training.
        psnr, ssim: Raw colours, all pixels.
        psnr_fit, ssim_fit: After a gain and offset per channel fitted to the truth.
        psnr_moving, psnr_rest: Raw, on pixels that differ from the camera's own background, and on the others.
        psnr_fit_moving, psnr_fit_rest: The same after the fit.
        moving_share: Share of moving pixels; figures on an empty set are null.
    """

    clip_index: int
    frame_index: int
    camera: str
    is_held_out: bool
    psnr: float
    ssim: float
    psnr_fit: float
    ssim_fit: float
    psnr_moving: float
    psnr_rest: float
    psnr_fit_moving: float
    psnr_fit_rest: float
    moving_share: float

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; NaN becomes None."""
        return {
            key: None if isinstance(value, float) and np.isnan(value) else value for key, value in asdict(self).items()
        }


def camera_gain(reference: ClipState, camera_name: str) -> np.ndarray:
    """Colour gain of a training camera, ones for a held-out one. [3] float32"""
    names = list(reference.header["camera_names"])
    if camera_name in names:
        return reference.arrays["gains"][names.index(camera_name)]
    return np.ones(3, np.float32)


def evaluate_clip(
    capture: Capture,
    clip: Clip,
    model: ClipModel,
    *,
    reference: ClipState,
    cameras: Sequence[int],
    holdout: Sequence[int],
    frames: Sequence[int] | None = None,
    on_row: Callable[[EvalRow], None] | None = None,
) -> list[EvalRow]:
    """Compare renders with the capture.

    Args:
        reference: The project's reference clip: gains, near plane, spacing.
        cameras: Camera indices to evaluate.
        holdout: Which of them were held out.
        frames: Capture frame indices; all of the clip when None.
        on_row: Called after each row, for progress.
    """
    near, reach = reference.header["near_plane"], REACH_SPACINGS * reference.header["spacing"]
    chosen = list(clip.frame_indices() if frames is None else frames)
    spread = spread_frames(capture.n_frames, _BACKGROUND_FRAMES)
    rows = []
    for camera in cameras:
        name = capture.rig.names[camera]
        width, height = (int(v) for v in capture.rig.image_sizes[camera])
        view = View.from_arrays(
            capture.rig.world_to_camera[camera],
            capture.rig.Ks[camera],
            width=width,
            height=height,
            near_plane=near,
        )
        background = estimate_background(capture.frames_of(camera, spread)).image
        gain = camera_gain(reference, name)
        for frame in chosen:
            pixels = capture.frame(camera, frame)
            image = render_model(model, view, clip.clip_time(frame), reach=reach).numpy() * gain
            row = compare(image, pixels, motion_mask(pixels, background))
            found = EvalRow(clip.clip_index, frame, name, camera in holdout, **row)
            rows.append(found)
            if on_row is not None:
                on_row(found)
    return rows


def compare(image: np.ndarray, pixels: np.ndarray, is_moving: np.ndarray) -> dict[str, float]:
    """All figures of one picture: image [H, W, 3] float, pixels [H, W, 3] uint8, is_moving [H, W] bool."""
    truth = pixels.astype(np.float32) / 255.0
    fitted = fit_colors(np.clip(image, 0.0, 1.0), truth)
    return {
        "psnr": psnr(image, truth),
        "ssim": ssim(image, truth),
        "psnr_fit": psnr(fitted, truth),
        "ssim_fit": ssim(fitted, truth),
        "psnr_moving": psnr(image, truth, is_moving),
        "psnr_rest": psnr(image, truth, ~is_moving),
        "psnr_fit_moving": psnr(fitted, truth, is_moving),
        "psnr_fit_rest": psnr(fitted, truth, ~is_moving),
        "moving_share": float(is_moving.mean()),
    }


def means(rows: Sequence[EvalRow]) -> dict[str, float | None]:
    """Mean of every figure over the rows that have it; None where none has."""
    names = [name for name, value in asdict(rows[0]).items() if isinstance(value, float)] if rows else []
    result: dict[str, float | None] = {}
    for name in names:
        values = np.array([getattr(row, name) for row in rows], np.float64)
        result[name] = None if np.isnan(values).all() else float(np.nanmean(values))
    return result
