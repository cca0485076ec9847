"""Rotations as matrices, quaternions and rotation vectors, many at once. numpy only: those of scipy look for torch on
every call, and fail while another thread imports it.

Quaternions are w x y z of unit length, as everywhere; a rotation vector is the axis times the angle in radians.
"""

from __future__ import annotations

import numpy as np


def quats_of(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions, w not negative, of rotation matrices [..., 3, 3]. [..., 4]"""
    rotations = np.asarray(rotations, dtype=np.float64)
    diagonal = np.diagonal(rotations, axis1=-2, axis2=-1)
    trace = diagonal.sum(-1, keepdims=True)
    squares = 1.0 + np.concatenate([trace, 2.0 * diagonal - trace], axis=-1)  # four times those of w, x, y, z
    largest = squares.argmax(-1)  # divided by: never a small one
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = np.moveaxis(rotations, (-2, -1), (0, 1))
    w, x, y, z = np.moveaxis(squares, -1, 0)
    products = np.stack(
        [
            np.stack([w, zy - yz, xz - zx, yx - xy], -1),
            np.stack([zy - yz, x, xy + yx, xz + zx], -1),
            np.stack([xz - zx, xy + yx, y, yz + zy], -1),
            np.stack([yx - xy, xz + zx, yz + zy, z], -1),
        ],
        axis=-2,
    )
    quats = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    quats = quats / np.linalg.norm(quats, axis=-1, keepdims=True)
    return np.where(quats[..., :1] < 0, -quats, quats)


def matrices_of(quats: np.ndarray) -> np.ndarray:
    """Rotation matrices of unit quaternions [..., 4]. [..., 3, 3]"""
    w, x, y, z = np.moveaxis(quats, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def quat_product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Quaternions of `second` followed by `first`, as matrices are multiplied. [..., 4]"""
    w, v = first[..., :1], first[..., 1:]
    other_w, other_v = second[..., :1], second[..., 1:]
    real = w * other_w - (v * other_v).sum(-1, keepdims=True)
    return np.concatenate([real, w * other_v + other_w * v + np.cross(v, other_v)], axis=-1)


def inverse_quats(quats: np.ndarray) -> np.ndarray:
    """Quaternions that turn back. [..., 4]"""
    return quats * np.array([1.0, -1.0, -1.0, -1.0])


def quats_of_turns(turns: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation vectors [..., 3]. [..., 4]"""
    turns = np.asarray(turns, dtype=np.float64)
    half = 0.5 * np.linalg.norm(turns, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * turns * np.sinc(half / np.pi)], axis=-1)


def turns_of_quats(quats: np.ndarray) -> np.ndarray:
    """Rotation vectors of unit quaternions [..., 4], the shorter way round: of length 0..pi. [..., 3]"""
    quats = np.where(quats[..., :1] < 0, -quats, quats)
    sine = np.linalg.norm(quats[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quats[..., :1])
    return quats[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
