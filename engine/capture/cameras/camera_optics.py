"""From a stored frame of one camera to a picture at the working size: lens, size, colours, and the border added to it.

Cameras of one capture may have frames of different sizes; their pictures all get one, and what was added is not valid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image

from engine.capture.pixels.undistortion import Undistortion


@dataclass(frozen=True, eq=False)
class CameraOptics:
    """How pictures of one camera come about.

    Attributes:
        stored_size: Width and height of stored frames.
        inner_size: Of what they become.
        picture_size: Of the whole picture; what lies right of and below the inner size is black.
        undistortion: From stored to inner pictures; None where only the size changes.
        color_matrix: New RGB = matrix @ old; None leaves colours as they are. [3, 3]
    """

    stored_size: tuple[int, int]
    inner_size: tuple[int, int]
    picture_size: tuple[int, int]
    undistortion: Undistortion | None = None
    color_matrix: np.ndarray | None = None

    def picture(self, stored: np.ndarray) -> np.ndarray:
        """A stored frame [H, W, 3] uint8 as a picture [picture H, picture W, 3] uint8; an own copy."""
        inner = resize_area(stored, self.inner_size) if self.undistortion is None else self.undistortion.apply(stored)
        if self.color_matrix is not None:
            mixed = inner.astype(np.float32) @ self.color_matrix.T.astype(np.float32)
            inner = np.clip(mixed + 0.5, 0.0, 255.0).astype(np.uint8)
        if self.inner_size == self.picture_size:
            return inner
        width, height = self.picture_size
        picture = np.zeros((height, width, 3), np.uint8)
        picture[: inner.shape[0], : inner.shape[1]] = inner
        return picture

    def mask(self, stored: np.ndarray) -> np.ndarray:
        """A stored mask [h, w, 3] uint8 of any size, bright where it is set, as one of the picture. [H, W] bool"""
        bright = np.where(stored.max(axis=-1, keepdims=True) > 127, 255, 0).astype(np.uint8)
        bright = np.repeat(bright, 3, axis=-1)
        if bright.shape[1::-1] != self.stored_size:
            bright = np.asarray(Image.fromarray(bright).resize(self.stored_size, Image.Resampling.NEAREST))
        shares = resize_area(bright, self.inner_size) if self.undistortion is None else self.undistortion.apply(bright)
        width, height = self.picture_size
        mask = np.zeros((height, width), bool)
        mask[: shares.shape[0], : shares.shape[1]] = shares[..., 0] > 127
        return mask

    def valid(self) -> np.ndarray | None:
        """Pixels of the picture that the camera sees. [H, W] bool, or None where it sees all."""
        if self.undistortion is None and self.inner_size == self.picture_size:
            return None
        (width, height), (inner_width, inner_height) = self.picture_size, self.inner_size
        valid = np.zeros((height, width), bool)
        valid[:inner_height, :inner_width] = True if self.undistortion is None else self.undistortion.valid()
        return None if valid.all() else valid


def resize_area(image: np.ndarray, size: np.ndarray | tuple[int, int]) -> np.ndarray:
    """Resample with a box filter: each new pixel is the mean of the area it covers.

    Args:
        image: [H, W, 3] uint8
        size: New width and height.
    Returns:
        [new H, new W, 3] uint8; an own copy, also where the size stays.
    """
    width, height = int(size[0]), int(size[1])
    if image.shape[:2] == (height, width):
        return np.array(image)
    return np.array(Image.fromarray(image).resize((width, height), Image.Resampling.BOX))
