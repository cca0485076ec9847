"""Lens distortion: where a point really falls on the sensor, in the models that calibrations are written in.

All work on normalised coordinates x/z, y/z of a pinhole camera; K then maps them to pixels. Parameters are named and
ordered as OpenCV and COLMAP have them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

LensModel = Literal["pinhole", "opencv", "fisheye", "fov", "thin_prism_fisheye"]
LENS_MODELS: tuple[LensModel, ...] = get_args(LensModel)
PARAMETER_NAMES: dict[LensModel, tuple[str, ...]] = {
    "pinhole": (),
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "fov": ("omega",),
    "thin_prism_fisheye": ("k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
}
"""Parameters of each model in order; missing ones at the end are zero."""
MAX_RADIUS = 20.0
"""Largest normalised radius that is looked at: 87 degrees off the axis; a pinhole picture holds no more."""
_SAMPLES = 4096
_ROUNDS = 100


@dataclass(frozen=True, slots=True)
class Lens:
    """How a lens bends rays. A value.

    Attributes:
        model: One of `LENS_MODELS`: "opencv" is polynomial with tangential, rational and prism terms; "fisheye" the
            equidistant model of OpenCV (Kannala-Brandt); "fov" and "thin_prism_fisheye" those of COLMAP.
        params: In the order of `PARAMETER_NAMES`, as many as are known.

    Raises:
        ValueError: The model is unknown, or has fewer parameters.
    """

    model: LensModel = "pinhole"
    params: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.model not in LENS_MODELS:
            raise ValueError(f"unknown lens model {self.model!r}")
        if len(self.params) > len(PARAMETER_NAMES[self.model]):
            raise ValueError(f"{self.model} has {len(PARAMETER_NAMES[self.model])} parameters, not {len(self.params)}")

    @property
    def is_pinhole(self) -> bool:
        """Whether nothing is bent."""
        return self.model == "pinhole" or (self.model == "opencv" and not any(self.params))

    @property
    def is_fisheye(self) -> bool:
        """Whether the model is made for views that may be wider than a pinhole picture holds."""
        return self.model in ("fisheye", "thin_prism_fisheye", "fov")

    def distort(self, xy: np.ndarray) -> np.ndarray:
        """Where points fall. Beyond `max_radius` the result means nothing.

        Args:
            xy: Pinhole coordinates x/z, y/z. [..., 2]
        Returns:
            Distorted coordinates, for K to map to pixels. [..., 2] float64
        """
        xy = np.asarray(xy, dtype=np.float64)
        if self.is_pinhole:
            return xy.copy()
        values = np.zeros(len(PARAMETER_NAMES[self.model]))
        values[: len(self.params)] = self.params
        x, y = xy[..., 0], xy[..., 1]
        if self.model == "opencv":
            return _opencv(x, y, values)
        radius = np.hypot(x, y)
        safe = np.maximum(radius, 1e-12)
        if self.model == "fov":
            omega = values[0]
            if abs(omega) < 1e-6:
                return xy.copy()
            factor = np.where(radius < 1e-9, 2 * np.tan(omega / 2) / omega, _fov(safe, omega) / safe)
            return xy * factor[..., None]
        theta = np.arctan(radius)
        scale = np.where(radius < 1e-9, 1.0, theta / safe)
        x, y = x * scale, y * scale  # the equidistant picture: distance from its middle is the angle
        if self.model == "fisheye":
            t2 = theta**2
            bend = 1.0 + t2 * (values[0] + t2 * (values[1] + t2 * (values[2] + t2 * values[3])))
            return np.stack([x * bend, y * bend], axis=-1)
        return _thin_prism(x, y, values)

    def undistort(self, xy: np.ndarray) -> np.ndarray:
        """Pinhole coordinates of points that fall at `xy`, found by damped Newton steps; NaN where there are none.

        Args:
            xy: Distorted coordinates. [..., 2]
        Returns:
            [..., 2] float64
        """
        wanted = np.asarray(xy, dtype=np.float64)
        if self.is_pinhole:
            return wanted.copy()
        limit = self.max_radius()
        found = _clipped(_first_guess(self, wanted), limit)
        error = self.distort(found) - wanted
        damping = np.ones(wanted.shape[:-1])
        for _ in range(_ROUNDS):
            jacobian = self._jacobian(found)
            determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
            determinant = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
            step = np.stack(
                [
                    jacobian[..., 1, 1] * error[..., 0] - jacobian[..., 0, 1] * error[..., 1],
                    jacobian[..., 0, 0] * error[..., 1] - jacobian[..., 1, 0] * error[..., 0],
                ],
                axis=-1,
            )
            trial = _clipped(found - damping[..., None] * step / determinant[..., None], limit)
            trial_error = self.distort(trial) - wanted
            is_better = (trial_error**2).sum(-1) < (error**2).sum(-1)
            found = np.where(is_better[..., None], trial, found)
            error = np.where(is_better[..., None], trial_error, error)
            damping = np.where(is_better, np.minimum(1.0, 2 * damping), damping / 4)
            if ((error**2).sum(-1) < 1e-24).all():
                break
        found[(error**2).sum(-1) > 1e-16] = np.nan
        return found

    def max_radius(self) -> float:
        """Normalised radius up to which points further out also fall further out; beyond, a polynomial folds back."""
        if self.is_pinhole:
            return MAX_RADIUS
        radii = np.tan(np.linspace(0.0, np.arctan(MAX_RADIUS), _SAMPLES))
        limit = MAX_RADIUS
        for angle in np.arange(0.0, 2 * np.pi, np.pi / 4):  # tangential terms make directions differ
            direction = np.array([np.cos(angle), np.sin(angle)])
            reached = self.distort(radii[:, None] * direction) @ direction
            with np.errstate(invalid="ignore"):
                falls = np.flatnonzero(~(np.diff(reached) > 0))
            if len(falls):
                limit = min(limit, float(radii[falls[0]]))
        return limit

    def _jacobian(self, xy: np.ndarray) -> np.ndarray:
        """Derivatives of `distort` by central differences. [..., 2, 2]"""
        across, down = 1e-6 * np.eye(2)
        by_x, by_y = (self.distort(xy + step) - self.distort(xy - step) for step in (across, down))
        return np.stack([by_x, by_y], axis=-1) / 2e-6


PINHOLE = Lens()


def _opencv(x: np.ndarray, y: np.ndarray, values: np.ndarray) -> np.ndarray:
    """OpenCV documentation of calib3d: radial, tangential, rational and thin prism terms."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = values
    r2 = x * x + y * y
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
            ],
            axis=-1,
        )


def _fov(radius: np.ndarray, omega: float) -> np.ndarray:
    return np.arctan(2 * radius * np.tan(omega / 2)) / omega


def _thin_prism(x: np.ndarray, y: np.ndarray, values: np.ndarray) -> np.ndarray:
    """COLMAP's THIN_PRISM_FISHEYE on equidistant coordinates."""
    k1, k2, p1, p2, k3, k4, sx1, sy1 = values
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + sx1 * r2,
            y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y) + sy1 * r2,
        ],
        axis=-1,
    )


def _first_guess(lens: Lens, xy: np.ndarray) -> np.ndarray:
    if not lens.is_fisheye:
        return xy.copy()
    angle = np.clip(np.linalg.norm(xy, axis=-1, keepdims=True), 1e-12, np.arctan(MAX_RADIUS))
    return xy * (np.tan(angle) / angle)


def _clipped(xy: np.ndarray, limit: float) -> np.ndarray:
    radius = np.linalg.norm(xy, axis=-1, keepdims=True)
    return xy * np.minimum(1.0, limit / np.maximum(radius, 1e-12))
