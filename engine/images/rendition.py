"""Rendition: what one camera makes of the scene's colours at one moment.

Its gain and exposure, one factor per channel, and the vignetting of its lens: the light that is lost towards the rim,
exp(a r^2 + b r^4) at a distance of r from the principal point, in half diagonals of the picture. A value that can be a
key. Source: Goldman 2010, vignette and exposure calibration, with the even polynomial in the exponent, which cannot
become negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engine.images.exposure_curve import to_camera, to_reference

RIM = 0.7
"""Squared radius at which lenses are compared: between the middle of a picture's short sides and its corners."""


class Rendition(NamedTuple):
    """See the module docstring.

    Attributes:
        gain: camera_colour = gain * scene_colour. RGB
        vignetting: a and b; zeros for none.
        center: The principal point, as shares of width and height.
    """

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignetting: tuple[float, float] = (0.0, 0.0)
    center: tuple[float, float] = (0.5, 0.5)

    @classmethod
    def of(
        cls, gain: np.ndarray, vignetting: np.ndarray | None, K: np.ndarray, image_size: np.ndarray | tuple[int, int]
    ) -> Rendition:
        """That of a camera.

        Args:
            gain: [3]
            vignetting: a and b; None for none. [2]
            K: [3, 3]
            image_size: Width and height that K is of.
        """
        r, g, b = (float(value) for value in gain)
        if vignetting is None or not vignetting.any():
            return cls((r, g, b))
        center = float(K[0, 2]) / float(image_size[0]), float(K[1, 2]) / float(image_size[1])
        return cls((r, g, b), (float(vignetting[0]), float(vignetting[1])), center)

    @property
    def is_plain(self) -> bool:
        """Whether the camera shows the scene's own colours."""
        return self.gain == (1.0, 1.0, 1.0) and self.vignetting == (0.0, 0.0)

    def falloff(self, width: int, height: int) -> np.ndarray | None:
        """Share of the light that reaches each pixel of a picture of any size; None for all of it. [H, W] float32"""
        if self.vignetting == (0.0, 0.0):
            return None
        x = np.arange(width, dtype=np.float32) + np.float32(0.5 - self.center[0] * width)
        y = np.arange(height, dtype=np.float32) + np.float32(0.5 - self.center[1] * height)
        return falloff_at(squared_radii(x[None], y[:, None], (width, height)), np.array(self.vignetting, np.float32))

    def to_scene(self, pixels: np.ndarray) -> np.ndarray:
        """A picture of the camera in the scene's colours, rounded. [H, W, 3] uint8"""
        return to_reference(pixels, np.array(self.gain), self.falloff(pixels.shape[1], pixels.shape[0]))

    def to_camera(self, image: np.ndarray) -> np.ndarray:
        """A picture in the scene's colours as the camera takes it, white staying white. [H, W, 3] float"""
        return to_camera(image, np.array(self.gain), self.falloff(image.shape[1], image.shape[0]))


def squared_radii(x: np.ndarray, y: np.ndarray, image_size: tuple[int, int] | np.ndarray) -> np.ndarray:
    """Squared distances from the principal point, in half diagonals of the picture. x, y: from there, pixels"""
    return (x * x + y * y) / np.float32(0.25 * (float(image_size[0]) ** 2 + float(image_size[1]) ** 2))


def falloff_at(squared: np.ndarray, vignetting: np.ndarray) -> np.ndarray:
    """Share of the light at squared radii. vignetting: a and b, [2]"""
    return np.exp(log_falloff(squared, vignetting))


def log_falloff(squared: np.ndarray, vignetting: np.ndarray) -> np.ndarray:
    """Log of the share of light at squared radii. [...], or [C, ...] with a and b of each camera [C, 2]"""
    a, b = (vignetting[..., i : i + 1] if vignetting.ndim > 1 else vignetting[i] for i in (0, 1))
    return squared * (a + b * squared)


def log_rims(vignetting: np.ndarray) -> np.ndarray:
    """Log of the share of light at the rim. [C, 2] to [C]"""
    return log_falloff(np.full((1, 1), RIM), vignetting)[:, 0]


def typical_vignetting(vignetting: np.ndarray) -> np.ndarray:
    """That of the median camera, by its rim: for a camera that nothing is known of. [C, 2] to [2]"""
    return vignetting[np.argsort(log_rims(vignetting), kind="stable")[len(vignetting) // 2]]
