"""A PinholeView as one float32 row, the form in which kernels take it."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.kernels.lanes import LaneBuilder, Lanes
from engine.raster.pinhole_view import PinholeView

_NAMES = (
    *(f"r{row}{column}" for row in range(3) for column in range(3)),
    *("t0", "t1", "t2", "fx", "fy", "cx", "cy"),
    *("slope_x_min", "slope_x_max", "slope_y_min", "slope_y_max"),
    *("width", "height", "near_plane"),
)


def camera_row(view: PinholeView) -> np.ndarray:
    """The numbers of `_NAMES` in order. [23] float32"""
    intrinsics = (view.fx, view.fy, view.cx, view.cy)
    numbers = (*intrinsics, *view.slope_limits(), view.width, view.height, view.near_plane)
    return np.concatenate([view.rotation.ravel(), view.translation, numbers]).astype(np.float32)


class CameraLanes:
    """The same numbers by name, each in all lanes."""

    def __init__(self, build: LaneBuilder, address: Any) -> None:
        for index, name in enumerate(_NAMES):
            setattr(self, name, build.broadcast(build.load_scalar(address, 4 * index)))

    def __getattr__(self, name: str) -> Lanes:  # for type checkers; set in __init__
        raise AttributeError(name)
