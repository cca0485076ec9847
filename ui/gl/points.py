"""Points as anti-aliased marks: disc, ring or diamond, of a size in pixels or in scene units.

Shape as well as hue distinguishes kinds of points, for eyes that do not distinguish the hues.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Literal

import moderngl
import numpy as np

from ui.gl.camera import NEAR, clip_matrix, uniform_matrix
from ui.gl.lines import with_alpha
from ui.gl.shaders import load_program
from ui.gl.targets import Target
from ui.style.colors import INHERITED, RESIDUAL

PointShape = Literal["circle", "ring", "diamond"]
SizeUnit = Literal["px", "world"]
_SHAPE_NUMBERS: dict[PointShape, int] = {"circle": 0, "ring": 1, "diamond": 2}
INHERITED_ANCHOR_COLOR = INHERITED
"""Drawn as circles."""
RESIDUAL_ANCHOR_COLOR = RESIDUAL
"""Drawn as diamonds."""


class PointRenderer:
    """Draws one set of points. Owns its buffer and program."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "point")
        self._max_size_px = float(ctx.info["GL_POINT_SIZE_RANGE"][1])
        self._buffer: moderngl.Buffer | None = None
        self._points: moderngl.VertexArray | None = None
        self._n_points = 0
        self._key: Hashable = None

    def __len__(self) -> int:
        """Points held."""
        return self._n_points

    def set(self, positions: np.ndarray, colors: np.ndarray, *, key: Hashable = None) -> bool:
        """Replace the points. Points that are not finite are dropped.

        Args:
            positions: World space. [N, 3]
            colors: RGB or RGBA in 0..1, one per point, or one for all. [N, 3 or 4] or [3 or 4]
            key: The same key as last time changes nothing; None always replaces.
        Returns:
            Whether anything was uploaded.
        Raises:
            ValueError: Shapes do not belong together.
        """
        if key is not None and key == self._key:
            return False
        positions = np.asarray(positions, dtype=np.float32)
        if positions.ndim != 2 or positions.shape[1] != 3:
            raise ValueError(f"point positions must be [N, 3], got {positions.shape}")
        colors = np.broadcast_to(with_alpha(colors), (len(positions), 4))
        points = np.concatenate([positions, colors], axis=1)
        points = points[np.isfinite(points).all(axis=1)]
        self._free_points()
        self._n_points = len(points)
        self._key = key
        if self._n_points:
            self._buffer = self._ctx.buffer(np.ascontiguousarray(points).tobytes())
            self._points = self._ctx.vertex_array(self._program, [(self._buffer, "3f 4f", "position", "color")])
        return True

    def draw(
        self,
        target: Target,
        world_to_camera: np.ndarray,
        K: np.ndarray,
        width: int,
        height: int,
        near: float = NEAR,
        *,
        shape: PointShape = "circle",
        size: float = 6.0,
        unit: SizeUnit = "px",
        outline_px: float = 0.0,
        opacity: float = 1.0,
        is_depth_tested: bool = False,
    ) -> None:
        """Blend the points over the contents of the target.

        Args:
            target: Where to; may differ in size from width x height.
            world_to_camera: Rigid map, OpenCV axes. [4, 4]
            K: Intrinsics in pixels of width x height. [3, 3]
            width: px.
            height: px.
            near: Points nearer than this are not drawn, scene units.
            shape: "circle" (disc), "ring", or "diamond" (a square on its tip).
            size: Diameter; of a diamond, corner to corner. At least one pixel, at most what the driver offers.
            unit: "px" of the target, or "world" scene units, then smaller when far.
            outline_px: Width of a dark rim inside the mark, which keeps it readable on any picture. 0 draws none.
            opacity: Multiplies the colours' alpha.
            is_depth_tested: Hide what lies behind depth already in the target, and write depth. Edges are then
                sharp, since a half-covered pixel has no depth of its own.
        """
        if self._points is None:
            return
        depth_flag = moderngl.DEPTH_TEST if is_depth_tested else moderngl.NOTHING
        target.use(moderngl.BLEND | moderngl.PROGRAM_POINT_SIZE | depth_flag)
        matrix = clip_matrix(world_to_camera, K, width, height, near=near)
        program = self._program
        program["world_to_clip"].write(uniform_matrix(matrix))  # type: ignore[union-attr]
        program["shape"] = _SHAPE_NUMBERS[shape]
        program["size"] = size
        # Pixels a length of one takes at depth one; 0 marks a size in pixels.
        program["px_per_unit"] = 0.0 if unit == "px" else float(K[1, 1]) * target.size[1] / height
        program["max_size_px"] = self._max_size_px
        program["outline_px"] = outline_px
        program["opacity"] = opacity
        program["is_sharp"] = is_depth_tested
        self._points.render(moderngl.POINTS, vertices=self._n_points)

    def release(self) -> None:
        """Free everything. The renderer cannot be used afterwards."""
        self._free_points()
        self._program.release()

    def _free_points(self) -> None:
        for thing in (self._points, self._buffer):
            if thing is not None:
                thing.release()
        self._points = self._buffer = None
        self._n_points = 0
