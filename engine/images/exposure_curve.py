"""One camera's exposure: pictures into another exposure and back, white staying white.

A camera's exposure at one moment is a gain per channel against a reference exposure. What is white in a picture was
cut off there and says nothing of how bright it was, so the upper end of the curve bends towards white: below the knee
`reference = camera / gain`, from there a straight line to white. The two directions undo each other.
"""

from __future__ import annotations

import numpy as np

KNEE = 0.9
"""Share of white up to which a gain is a plain factor, in the darker of the two pictures' scales."""


def to_reference(pixels: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """A picture as the camera would have taken it in the reference exposure, rounded.

    Args:
        pixels: [..., 3] uint8
        gain: Of the camera when it took the picture, finite and above 0. [3]
    Returns:
        [..., 3] uint8; the pixels themselves where the gain is 1.
    """
    if (gain == 1.0).all():
        return pixels
    levels = np.arange(256) / 255.0
    result = np.empty_like(pixels)
    for channel in range(3):
        camera_knots, reference_knots = _curve(float(gain[channel]))
        table = np.floor(np.interp(levels, camera_knots, reference_knots) * 255.0 + 0.5).astype(np.uint8)
        np.take(table, pixels[..., channel], out=result[..., channel])
    return result


def to_camera(image: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """A picture of the reference exposure as the camera takes it in another one.

    Args:
        image: 0 to 1; what lies above stays as far above. [..., 3] float
        gain: As in `to_reference`. [3]
    Returns:
        Same shape and dtype; the image itself where the gain is 1.
    """
    if (gain == 1.0).all():
        return image
    result = np.empty_like(image)
    for channel in range(3):
        camera_knots, reference_knots = _curve(float(gain[channel]))
        values = image[..., channel]
        result[..., channel] = np.interp(values, reference_knots, camera_knots) + np.maximum(values - 1.0, 0.0)
    return result


def _curve(gain: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Where the curve bends, as the camera's values and as those of the reference exposure."""
    camera_knee = KNEE * min(gain, 1.0)
    return (0.0, camera_knee, 1.0), (0.0, camera_knee / gain, 1.0)
