"""Shared by several file formats: rotations by their three smaller components, an order along a space-filling curve,
and whole numbers of a few bits."""

from __future__ import annotations

import numpy as np

_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_MORTON_BITS = 21


def smaller_three(quats: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest component's index and the other three in their order, of the rotation with that one positive.

    Args:
        quats: Unit length, components in the order that is wanted. [N, 4]
    Returns:
        [N] int64; [N, 3] float64 within +-sqrt(1/2).
    """
    quats = quats.astype(np.float64)
    largest = np.abs(quats).argmax(1)
    signs = np.where(np.take_along_axis(quats, largest[:, None], 1) < 0.0, -1.0, 1.0)
    return largest, np.take_along_axis(quats * signs, _OTHERS[largest], 1)


def quats_of_smaller_three(largest: np.ndarray, three: np.ndarray) -> np.ndarray:
    """The inverse of `smaller_three`. [N, 4] float32"""
    quats = np.empty((len(largest), 4))
    np.put_along_axis(quats, _OTHERS[largest], three, 1)
    rest = np.sqrt(np.maximum(0.0, 1.0 - np.square(three).sum(1)))
    np.put_along_axis(quats, largest[:, None], rest[:, None], 1)
    return quats.astype(np.float32)


def morton_order(means: np.ndarray) -> np.ndarray:
    """Rows in the order of a curve along which neighbours are near each other in space. [N]"""
    if not len(means):
        return np.zeros(0, np.int64)
    low = means.min(0).astype(np.float64)
    extent = means.max(0) - low
    cells = (means - low) * ((2**_MORTON_BITS - 1) / np.where(extent > 0.0, extent, 1.0))
    x, y, z = (_spread(column) for column in cells.astype(np.uint64).T)
    return np.argsort(x | (y << np.uint64(1)) | (z << np.uint64(2)), kind="stable")


def _spread(values: np.ndarray) -> np.ndarray:
    """21 bits, each followed by two zeros."""
    for shift, mask in (
        (32, 0x001F00000000FFFF),
        (16, 0x001F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values


def as_levels(values: np.ndarray, n_bits: int = 8) -> np.ndarray:
    """0..1 as the nearest whole numbers of that many bits. Same shape, uint32"""
    top = (1 << n_bits) - 1
    return np.floor(np.clip(values, 0.0, 1.0) * top + 0.5).astype(np.uint32)
