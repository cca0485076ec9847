"""One camera's exposure: pictures into another exposure and back, white staying white.

A camera's exposure at one moment is a gain per channel against a reference exposure, times what its lens loses towards
the rim of the picture. What is white in a picture was cut off there and says nothing of how bright it was, so the upper
end of the curve bends towards white: below the knee `reference = camera / gain`, from there a straight line to white.
The two directions undo each other.
"""

from __future__ import annotations

import numpy as np

KNEE = 0.9
"""Share of white up to which a gain is a plain factor, in the darker of the two pictures' scales."""
_STEPS = 400
"""Levels of falloff per unit of its logarithm: a quarter of a per cent each, less than rounding to 8 bits."""


def to_reference(pixels: np.ndarray, gain: np.ndarray, falloff: np.ndarray | None = None) -> np.ndarray:
    """A picture as the camera would have taken it in the reference exposure, rounded.

    Args:
        pixels: [..., 3] uint8
        gain: Of the camera when it took the picture, finite and above 0. [3]
        falloff: Share of the light that reaches each pixel, above 0; None for all of it. [H, W] float32
    Returns:
        Like the pixels; the pixels themselves where nothing changes.
    """
    if falloff is None and (gain == 1.0).all():
        return pixels
    levels = np.zeros((), np.int32) if falloff is None else np.rint(_STEPS * np.log(falloff)).astype(np.int32)
    lowest, highest = (int(levels.min()), int(levels.max())) if levels.size else (0, 0)
    shares = np.exp(np.arange(lowest, highest + 1) / _STEPS)
    gains = shares * np.asarray(gain, np.float64)[:, None]  # [3, L]
    tables = np.floor(_reference_values(np.arange(256) / 255.0, gains[..., None]) * 255.0 + 0.5).astype(np.uint8)
    rows, result = 256 * (levels - lowest), np.empty(pixels.shape, np.uint8)
    for channel, table in enumerate(tables):  # [L, 256] each
        result[..., channel] = np.take(table, rows + pixels[..., channel])
    return result


def to_camera(image: np.ndarray, gain: np.ndarray, falloff: np.ndarray | None = None) -> np.ndarray:
    """A picture of the reference exposure as the camera takes it in another one.

    Args:
        image: 0 to 1; what lies above stays as far above. [..., 3] float
        gain, falloff: As in `to_reference`.
    Returns:
        Same shape and dtype; the image itself where nothing changes.
    """
    if falloff is None and (gain == 1.0).all():
        return image
    result = np.empty_like(image)
    for channel in range(3):
        gains = np.asarray(gain[channel] if falloff is None else gain[channel] * falloff, image.dtype)
        camera_knee = KNEE * np.minimum(gains, 1)
        reference_knee = camera_knee / gains
        values = np.maximum(image[..., channel], 0)
        above = camera_knee + (values - reference_knee) * ((1 - camera_knee) / (1 - reference_knee))
        result[..., channel] = np.where(values > 1, values, np.where(values <= reference_knee, values * gains, above))
    return result


def _reference_values(values: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """What values of a camera, 0 to 1, are in the reference exposure."""
    camera_knee = KNEE * np.minimum(gains, 1.0)
    reference_knee = camera_knee / gains
    above = reference_knee + (values - camera_knee) * ((1.0 - reference_knee) / (1.0 - camera_knee))
    return np.minimum(np.where(values <= camera_knee, values / gains, above), 1.0)
