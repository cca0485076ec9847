"""Lenses that are written as a correction of what was seen, brought to OpenCV's model, which says where a ray falls."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.camera.lens import PINHOLE, Lens
from engine.errors import CaptureError

MAX_ERROR_PX = 0.5
"""How far the two models may be apart anywhere in the picture: 0.0001 px where both have one centre, some tenths where
the centre of the correction lies 20 px off the principal point."""
_ACROSS = 33
"""Samples of the picture along each side."""
_ROUNDS = 6
_RADIAL, _RATIONAL, _OTHERS = (0, 1, 4), (5, 6, 7), (2, 3, 8, 9, 10, 11)
"""Which parameters of OpenCV's model are k1 to k3, k4 to k6, and those that stand next to the fraction."""


def lens_of_correction(
    K: np.ndarray, size: tuple[int, int], centre: np.ndarray, coefficients: np.ndarray, *, path: Path
) -> Lens:
    """The lens whose seen points, moved away from a centre by 1 + k1 r^2 + k2 r^4 + k3 r^6, are those of a pinhole.

    Args:
        K: Of the pinhole, pixels. [3, 3]
        size: Width and height of the picture.
        centre: From where r counts, pixels. [2]
        coefficients: k1, k2 and k3 for r in pixels. [3]
        path: The file they come from.
    Raises:
        CaptureError: OpenCV's model misses the correction by more than MAX_ERROR_PX somewhere in the picture.
    """
    if not np.any(coefficients):
        return PINHOLE
    with np.errstate(all="ignore"):
        params, error_px = _fitted(K, size, centre, coefficients)
    if not error_px <= MAX_ERROR_PX:
        text = f"Its lens does not fit OpenCV's model: the error is {error_px:.3g} px."
        raise CaptureError(text, hint="Undistort the videos, or calibrate again.", path=path)
    return Lens("opencv", tuple(params.tolist()))


def _fitted(
    K: np.ndarray, size: tuple[int, int], centre: np.ndarray, coefficients: np.ndarray
) -> tuple[np.ndarray, float]:
    """Parameters of OpenCV's model by least squares, and the largest error in pixels.

    Multiplied by its denominator the model is linear in all parameters but for products of small ones, which are taken
    from the round before.
    """
    across, down = (np.linspace(0.0, side, _ACROSS) for side in size)
    seen = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    r2 = ((seen - centre) ** 2).sum(-1, keepdims=True)
    k1, k2, k3 = coefficients
    straight = centre + (seen - centre) * (1 + r2 * (k1 + r2 * (k2 + r2 * k3)))
    focal, middle = np.diag(K)[:2], K[:2, 2]
    wanted, at = (seen - middle) / focal, (straight - middle) / focal
    if not np.isfinite(at).all():
        return np.zeros(12), np.inf
    powers = [(at**2).sum(-1, keepdims=True) ** power for power in (1, 2, 3)]
    beside = [Lens("opencv", tuple(np.eye(12)[index].tolist())).distort(at) - at for index in _OTHERS]
    fits: list[tuple[float, np.ndarray]] = []
    for has_fraction in (False, True):  # a fraction is better where both centres are one, and useless elsewhere
        params, below, moved = np.zeros(12), np.ones_like(r2), np.zeros_like(at)
        used = [*_RADIAL, *_OTHERS, *(_RATIONAL if has_fraction else ())]
        for _ in range(_ROUNDS if has_fraction else 1):
            columns = [at * power for power in powers] + [column * below for column in beside]
            columns += [(moved - wanted) * power for power in powers] if has_fraction else []
            weighted = np.stack([(column / below).ravel() for column in columns], axis=-1)
            scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-30)
            found, *_ = np.linalg.lstsq(weighted / scale, ((wanted - at) / below).ravel(), rcond=1e-10)
            params[used] = found / scale
            below = 1 + sum(params[index] * power for index, power in zip(_RATIONAL, powers, strict=True))
            moved = sum((params[index] * column for index, column in zip(_OTHERS, beside, strict=True)), 0 * at)
        error = (Lens("opencv", tuple(params.tolist())).distort(at) - wanted) * focal
        fits.append((float(np.abs(error).max()), params))
    error_px, params = min(fits, key=lambda fit: fit[0])
    return params, error_px
