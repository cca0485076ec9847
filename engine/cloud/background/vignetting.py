"""Vignetting of the cameras' lenses, from points that several cameras see at different distances from their centres.

What a camera shows too dark near its rim and too bright near its centre, against the median of the cameras that see the
same points. Alternates with the cameras' gains (engine.cloud.background.gains), robustly, since wrong depths and gloss
are among the observations. Left out where both sides of the pictures do not say the same, or rims come out brighter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.projection import project, projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.gains import MAX_SPLIT_POINTS, MIN_SPREAD, MIN_SPREAD_RATIO, gains_from_observations
from engine.images.rendition import log_falloff, log_rims, squared_radii

MIN_OBSERVATIONS = 200
"""Of a camera; one with fewer is taken to be like the median of the others."""
MIN_CAMERAS = 3
"""Cameras that must see a point: of two, the median is their mean, and each takes half of the other's rim."""
BRIGHTEST = 235.0
"""Grey levels above are cut off and say nothing of the light."""
MAX_LOG_RIM = 1.5
"""Nothing stronger is believed: a rim of a fifth of the centre's brightness."""
_N_ROUNDS = 12
_N_REWEIGHTED = 8
_SOFT = 0.01
"""Log error up to which an observation counts in full."""
_RIDGE = 3e-5
"""Of both coefficients, per observation: keeps the rim of a camera that saw nothing there near its centre's light."""


@dataclass(frozen=True, slots=True)
class Vignetting:
    """What was found of the lenses.

    Attributes:
        coefficients: a and b of engine.images.rendition.Rendition; zeros where nothing is corrected. [C, 2] float32
        text: What was found and decided, one clause.
    """

    coefficients: np.ndarray
    text: str


def point_radii(points: np.ndarray, rig: CameraRig) -> np.ndarray:
    """Squared distances of projected points from the principal points, in half diagonals. [C, P] float32"""
    radii = np.zeros((len(rig), len(points)), np.float32)
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, depths = project(points, projection)
        x, y = (np.where(depths > 0, pixels[:, axis] - rig.Ks[camera, axis, 2], 0.0) for axis in (0, 1))
        radii[camera] = squared_radii(x, y, rig.image_sizes[camera])
    return radii


def measure_vignetting(points: np.ndarray, log_colors: np.ndarray, rig: CameraRig) -> Vignetting:
    """Vignetting of every camera.

    Args:
        points: [P, 3]
        log_colors: log(colour + 1) of each point in each camera, NaN where not seen. [C, P, 3]
        rig: Of these cameras, at the size of the pictures.
    """
    step = -(-len(points) // MAX_SPLIT_POINTS) if len(points) else 1
    points, log_colors = points[::step], np.array(log_colors[:, ::step], np.float32)
    log_colors[(log_colors > np.log(BRIGHTEST + 1.0)).any(-1)] = np.nan
    squared = point_radii(points, rig)
    is_used = np.isfinite(log_colors[..., 0])
    is_used &= is_used.sum(0) >= MIN_CAMERAS
    is_measured = is_used.sum(1) >= MIN_OBSERVATIONS
    nothing = np.zeros((len(rig), 2), np.float32)
    if is_measured.sum() < MIN_CAMERAS:
        return Vignetting(nothing, "too little is seen by several cameras to tell")
    coefficients, gains = nothing.astype(np.float64), np.ones((len(rig), 3))
    errors = np.zeros_like(squared)
    for _ in range(_N_ROUNDS):
        falloff = log_falloff(squared, coefficients)
        gains, colors = gains_from_observations(log_colors - falloff[..., None].astype(np.float32), gains)
        residuals = log_colors - np.log(gains)[:, None] - np.log(colors + 1.0)
        errors = np.median(residuals, axis=-1)  # NaN where not seen
        for camera in np.flatnonzero(is_measured):
            rows = is_used[camera]
            coefficients[camera] = _fitted(squared[camera, rows], errors[camera, rows])
    rims = log_rims(coefficients)
    spread = float(np.sqrt(np.mean(rims[is_measured] ** 2)))
    brightening = float(np.sqrt(np.mean(np.maximum(rims[is_measured], 0.0) ** 2)))  # which no lens does
    uncertainty = max(_side_difference(points, squared, errors, is_used, rig), brightening)
    numbers = f"rims are {_percent(rims[is_measured].max())} to {_percent(rims[is_measured].min())} % darker"
    numbers += f" than centres, uncertain by {100 * uncertainty:.1f} %"
    if spread <= max(MIN_SPREAD, MIN_SPREAD_RATIO * uncertainty) or np.abs(rims).max() > MAX_LOG_RIM:
        return Vignetting(nothing, f"{numbers}; not corrected")
    measured = np.flatnonzero(is_measured)
    typical = measured[np.argsort(rims[measured])[len(measured) // 2]]
    coefficients[~is_measured] = coefficients[typical]
    return Vignetting(coefficients.astype(np.float32), f"{numbers}; corrected")


def _percent(log_rim: float) -> str:
    return str(round(100 * (1 - float(np.exp(log_rim)))))


def _fitted(squared: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """a and b by reweighted least squares, about the absolute error, with a gain that absorbs what is left of it."""
    columns = np.stack([np.ones_like(squared), squared, squared**2], axis=1).astype(np.float64)
    ridge = _RIDGE * len(squared) * np.diag([0.0, 1.0, 1.0])
    weights, solution = np.ones(len(squared)), np.zeros(3)
    for _ in range(_N_REWEIGHTED):
        weighted = columns * weights[:, None]
        solution = np.linalg.solve(columns.T @ weighted + ridge * weights.mean(), weighted.T @ errors)
        weights = _SOFT / np.maximum(np.abs(errors - columns @ solution), _SOFT)
    return solution[1:]


def _side_difference(
    points: np.ndarray, squared: np.ndarray, errors: np.ndarray, is_used: np.ndarray, rig: CameraRig
) -> float:
    """Standard error of a rim, from how far the left and right halves of pictures are from their mean.

    Infinite where no camera has enough on both sides. A lens darkens both alike, the scene's light does not.
    """
    differences = []
    for camera, projection in enumerate(projection_matrices(rig)):
        pixels, depths = project(points, projection)
        is_left = np.where(depths > 0, pixels[:, 0], 0.0) < rig.Ks[camera, 0, 2]
        sides = [is_used[camera] & is_left, is_used[camera] & ~is_left]
        if min(side.sum() for side in sides) < MIN_OBSERVATIONS / 2:
            continue
        found = np.stack([_fitted(squared[camera, side], errors[camera, side]) for side in sides])
        left, right = log_rims(found)
        differences.append(abs(left - right) / 2)
    return 1.48 * float(np.median(differences)) if differences else float("inf")
