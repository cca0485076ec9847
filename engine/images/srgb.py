"""The curve of sRGB: between colours as displays take them and light."""

from __future__ import annotations

import numpy as np


def linear_of(encoded: np.ndarray) -> np.ndarray:
    """Light of display-encoded colours. Both in 0..1, brighter ones as the curve continues. [...]"""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encoded_of(linear: np.ndarray) -> np.ndarray:
    """Display-encoded colours of light: the inverse of `linear_of`. [...]"""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
