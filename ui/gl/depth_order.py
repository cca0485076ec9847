"""Depth order of splats, exact, and the request for one. Knows no GL.

Exact because 16-bit depth keys cost 47 dB instead of 130 in a scene with a far background; a stale exact order of a
view some degrees away costs less than that, and only for a frame or two.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

OrderKey = tuple[int, bytes, float]
"""Which rows, seen by which row of world_to_camera, beyond which near plane."""
_LOW_32_BITS = np.uint64(0xFFFFFFFF)


def depth_order(means: np.ndarray, view_row: np.ndarray, near: float) -> np.ndarray:
    """Rows in front of the near plane, farthest first; equal depths are the reverse of the row order.

    Reverse, so that drawing back to front composites exactly what a stable front-to-back rasterizer does.

    Args:
        means: Centres, world space, finite. [N, 3] float32
        view_row: Third row of world_to_camera: camera z = view_row[:3] . p + view_row[3]. [4]
        near: Rows with camera z not above this are left out, scene units, >= 0.
    Returns:
        Row numbers. [M] uint32, M <= N
    """
    row = np.asarray(view_row, dtype=np.float64)
    # From the near plane on: seen from very far away the depths themselves are too coarse to distinguish neighbours.
    depths = means @ row[:3].astype(np.float32) + np.float32(row[3] - max(near, 0.0))  # [N]
    visible = np.flatnonzero(depths > 0.0)
    # Positive floats sort like their bit patterns, so depth and row number pack into one integer that an in-place
    # sort without an index array handles: several times faster than argsort.
    keys = depths[visible].view(np.uint32).astype(np.uint64)
    keys <<= np.uint64(32)
    keys |= visible.astype(np.uint64)
    keys.sort()
    return (keys & _LOW_32_BITS).astype(np.uint32)[::-1].copy()


@dataclass(frozen=True, slots=True)
class DepthOrder:
    """A finished order.

    Attributes:
        key: Key of the request.
        ids: Row numbers, farthest first. [M] uint32
    """

    key: OrderKey
    ids: np.ndarray


@dataclass(frozen=True, slots=True)
class OrderRequest:
    """An order to come; requests with the same key are the same. Other attributes are the arguments of depth_order.

    `means` must not change afterwards.
    """

    key: OrderKey
    means: np.ndarray = field(compare=False)
    view_row: np.ndarray = field(compare=False)
    near: float = field(compare=False)

    def answer(self) -> DepthOrder:
        """Sort now."""
        return DepthOrder(self.key, depth_order(self.means, self.view_row, self.near))
