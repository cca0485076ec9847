"""The pinhole camera that the pictures of a real lens are brought to: its K, its map, and where it sees anything."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field

import numpy as np

from engine.camera.lens import Lens

FISHEYE_FOV_DEG = 110.0
"""Width of view that pictures of a fisheye are brought to, unless the capture says another: at 110 degrees the border
of a pinhole picture is already drawn out to three times the scale of its middle."""
MAX_FOV_DEG = 150.0
_STEP_PX = 2
"""Of the lattice on which the map is kept: between its points it is off by some thousandths of a pixel."""


def undistorted_K(
    K: np.ndarray, lens: Lens, image_size: tuple[int, int], fisheye_fov_deg: float | None = None
) -> np.ndarray:
    """Intrinsics of the pinhole camera that pictures of this one are brought to, of the same size.

    Ordinary lenses keep their K, so that the middle of the picture stays as it is. Of a fisheye, which may see more
    than any pinhole picture holds, the middle is made smaller until the view asked for fits.

    Args:
        K: Of the camera as it is. [3, 3]
        fisheye_fov_deg: Horizontal view of fisheye pictures; None takes FISHEYE_FOV_DEG. Less where the lens sees less.
    """
    K = np.array(K, dtype=np.float64)
    if not lens.is_fisheye:
        return K
    width, _ = image_size
    wanted = math.radians(min(FISHEYE_FOV_DEG if fisheye_fov_deg is None else fisheye_fov_deg, MAX_FOV_DEG))
    edges = np.array([[-K[0, 2] / K[0, 0], 0.0], [(width - K[0, 2]) / K[0, 0], 0.0]])
    seen = np.arctan(np.nan_to_num(np.abs(lens.undistort(edges)[:, 0]), nan=lens.max_radius()))
    half = min(wanted / 2, float(seen.max()))
    focal = max(K[0, 2], width - K[0, 2]) / math.tan(half)
    K[1, 1] *= focal / K[0, 0]
    K[0, 0] = focal
    return K


@dataclass(frozen=True, eq=False)
class Undistortion:
    """From stored pictures of one camera to pinhole pictures at a working size. Safe to use from several threads.

    Attributes:
        lens, K, image_size: Of the stored pictures; centres of pixels at +0.5.
        new_K, new_size: Of the pinhole pictures.
    """

    lens: Lens
    K: np.ndarray
    image_size: tuple[int, int]
    new_K: np.ndarray
    new_size: tuple[int, int]
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)
    _made: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    def apply(self, image: np.ndarray) -> np.ndarray:
        """A stored picture [H, W, 3] uint8 as a pinhole picture [new H, new W, 3] uint8, black where not valid."""
        from engine.images.remap import remap  # numba: only whoever decodes pictures of a lens needs it

        valid = self.valid()
        with self._lock:
            lattice = self._made.get("lattice")
            if lattice is None:
                lattice = self._made["lattice"] = self._lattice()
        shrinking = max(self.K[0, 0] / self.new_K[0, 0], self.K[1, 1] / self.new_K[1, 1])
        return remap(image, lattice, _STEP_PX, self.new_size, max(1, math.ceil(shrinking - 1e-6)), valid)

    def valid(self) -> np.ndarray:
        """Pixels of the pinhole picture that the stored picture reaches. [new H, new W] bool, read-only"""
        with self._lock:
            valid = self._made.get("valid")
            if valid is None:
                valid = self._made["valid"] = self._valid()
                valid.flags.writeable = False
        return valid

    def _valid(self) -> np.ndarray:
        width, height = self.new_size
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        places, is_reached = self._places(np.stack([x, y], axis=-1))
        inside = (places >= 0.5).all(-1) & (places <= np.array(self.image_size) - 0.5).all(-1)
        return inside & is_reached

    def _lattice(self) -> np.ndarray:
        width, height = self.new_size
        x = np.arange(0, width + 2 * _STEP_PX, _STEP_PX, dtype=np.float64)
        y = np.arange(0, height + 2 * _STEP_PX, _STEP_PX, dtype=np.float64)
        places, is_reached = self._places(np.stack(np.meshgrid(x, y), axis=-1))
        places = np.where(is_reached[..., None], places, -1.0)
        return np.clip(np.nan_to_num(places, nan=-1.0), -1.0, 1e5).astype(np.float32)

    def _places(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stored pixels [..., 2] of pinhole pixels [..., 2], and whether the lens model reaches as far."""
        normalised = (pixels - self.new_K[:2, 2]) / np.diag(self.new_K)[:2]
        bent = self.lens.distort(normalised)
        is_reached = np.linalg.norm(normalised, axis=-1) <= self.lens.max_radius()
        return bent * np.diag(self.K)[:2] + self.K[:2, 2], is_reached & np.isfinite(bent).all(-1)
