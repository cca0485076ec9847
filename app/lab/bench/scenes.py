"""The scenes that the rasterizer is measured with."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.lab.synthetic.gaussian_scenes import GaussianScene, layered_scene


@dataclass(frozen=True, slots=True)
class Recipe:
    """Arguments of `layered_scene`."""

    n_rows: int
    width: int
    height: int
    size_px: float
    faint: bool = False

    def scene(self) -> GaussianScene:
        """The scene of this recipe."""
        return layered_scene(self.n_rows, self.width, self.height, self.size_px, faint=self.faint)

    def reduced(self) -> Recipe:
        """The same overlap per pixel in a picture of 80 x 60; this recipe itself where it is as small."""
        if self.width * self.height <= SMALL_PX:
            return self
        n_rows = max(100, self.n_rows * 80 * 60 // (self.width * self.height))
        return replace(self, n_rows=n_rows, width=80, height=60)


SMALL_PX = 160 * 120
"""Pictures of up to so many pixels are drawn by brute force in float64 as they are."""

RECIPES = {
    "accuracy": Recipe(2_000, 160, 120, 3.5),
    "small": Recipe(10_000, 320, 240, 3.2),
    "heavy": Recipe(20_000, 320, 240, 9.0, faint=True),
    "medium": Recipe(50_000, 640, 480, 3.2),
    "large": Recipe(200_000, 1280, 720, 3.0),
}
"""Sizes of the measurements that chose the design: median splat 3 px, or 9 px and faint."""
