"""SeenFrom: the view in which something is selected. Plain numbers, as the window and scripts both have them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class SeenFrom:
    """From where, through which lens, at which size.

    Attributes:
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels of width x height, pixel centres at +0.5. [3, 3]
        width, height: Of the picture, px.
        near: Centres that are not farther than this cannot be seen, scene units.
        set_back: How much farther away the camera stands than it seems to, as that of an orthographic view does; scene
            units.

    Raises:
        ValueError: A shape is wrong, a number is not finite, or the picture is empty.
    """

    world_to_camera: np.ndarray
    K: np.ndarray
    width: int
    height: int
    near: float = 0.01
    set_back: float = 0.0

    def __post_init__(self) -> None:
        if np.shape(self.world_to_camera) != (4, 4) or np.shape(self.K) != (3, 3):
            raise ValueError("a view needs a pose [4, 4] and intrinsics [3, 3]")
        numbers = (*np.ravel(self.world_to_camera), *np.ravel(self.K), self.near, self.set_back)
        if not np.isfinite(numbers).all():
            raise ValueError("a view has a number that is not finite")
        if self.width < 1 or self.height < 1 or self.K[0, 0] <= 0.0 or self.K[1, 1] <= 0.0:
            raise ValueError(f"a view of {self.width} x {self.height} pixels shows nothing")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.width, self.height
