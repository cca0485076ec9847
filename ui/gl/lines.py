"""Anti-aliased lines of any width as instanced quads, and the lines that show where cameras stand.

Quads, because core OpenGL need not draw lines wider than one pixel, and most drivers do not.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable

import moderngl
import numpy as np

from engine.camera.rig import CameraRig
from ui.gl.camera import NEAR, clip_matrix, uniform_matrix
from ui.gl.shaders import load_program
from ui.gl.targets import Target
from ui.style.colors import CHOSEN, HELD_OUT, Color

LINES_PER_FRUSTUM = 10
TRAINING_CAMERA_COLOR = (0.82, 0.85, 0.89, 1.0)
"""Neutral light grey: training cameras are the rule, so they carry no hue."""
HELD_OUT_CAMERA_COLOR = HELD_OUT
CHOSEN_CAMERA_COLOR = CHOSEN
_FLOATS_PER_LINE = 14


def frusta_lines(
    rig: CameraRig,
    size: float,
    held_out: Collection[int] = (),
    *,
    chosen: int | None = None,
    color: Color = TRAINING_CAMERA_COLOR,
) -> tuple[np.ndarray, np.ndarray]:
    """Pyramids at the cameras, with a small roof above the picture's upper edge.

    Args:
        rig: Which cameras, at which image sizes. C cameras
        size: From the camera's centre to the middle of its picture, scene units, for a picture as wide as it is deep;
            longer lenses are drawn longer and not wider, so that all pyramids look about equally large.
        held_out: Rows of the rig drawn in purple.
        chosen: Row drawn in yellow, whatever else it is.
        color: Of all others.
    Returns:
        vertices: Two per line. [C * LINES_PER_FRUSTUM * 2, 3] float32
        colors: RGBA. [C * LINES_PER_FRUSTUM * 2, 4] float32
    """
    n_cameras = len(rig)
    widths, heights = rig.image_sizes[:, 0].astype(np.float64), rig.image_sizes[:, 1].astype(np.float64)
    # Picture corners clockwise from the upper left, then the tip of the roof. [C, 5, 2] px
    roof_y = -0.22 * heights
    corners_px = np.stack(
        [
            np.stack([0 * widths, 0 * heights], -1),
            np.stack([widths, 0 * heights], -1),
            np.stack([widths, heights], -1),
            np.stack([0 * widths, heights], -1),
            np.stack([0.5 * widths, roof_y], -1),
        ],
        axis=1,
    )
    rays = np.concatenate([corners_px, np.ones((n_cameras, 5, 1))], axis=-1) @ np.linalg.inv(rig.Ks).swapaxes(1, 2)
    picture_width = rays[:, 1, 0] - rays[:, 0, 0]  # at depth 1
    points_camera = rays * (size / np.sqrt(picture_width))[:, None, None]  # [C, 5, 3]
    rotations = rig.world_to_camera[:, :3, :3]
    points = points_camera @ rotations + rig.centers[:, None, :]  # row vectors, so R^T is applied by R on the right
    points = np.concatenate([rig.centers[:, None, :], points], axis=1)  # [C, 6, 3], 0 the centre, 5 the tip
    pairs = [(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4), (4, 1), (1, 5), (5, 2)]
    vertices = points[:, np.array(pairs).reshape(-1)]  # [C, 20, 3]
    camera_colors = np.tile(np.array(color, dtype=np.float32), (n_cameras, 1))
    camera_colors[sorted(held_out)] = HELD_OUT_CAMERA_COLOR
    if chosen is not None:
        camera_colors[chosen] = CHOSEN_CAMERA_COLOR
    colors = np.repeat(camera_colors, 2 * LINES_PER_FRUSTUM, axis=0)
    return vertices.reshape(-1, 3).astype(np.float32), colors


def with_alpha(colors: np.ndarray) -> np.ndarray:
    """RGB or RGBA rows as RGBA float32; missing alpha is 1. [N, 3 or 4] -> [N, 4]"""
    colors = np.asarray(colors, dtype=np.float32)
    if colors.shape[-1] == 4:
        return colors
    return np.concatenate([colors, np.ones_like(colors[..., :1])], axis=-1)


class LineRenderer:
    """Draws one set of line segments. Owns its buffer and program."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "line")
        self._buffer: moderngl.Buffer | None = None
        self._quads: moderngl.VertexArray | None = None
        self._n_lines = 0
        self._key: Hashable = None

    def __len__(self) -> int:
        """Lines held."""
        return self._n_lines

    def set(self, vertices: np.ndarray, colors: np.ndarray, *, key: Hashable = None) -> bool:
        """Replace the lines. Lines that are not finite are dropped.

        Args:
            vertices: World space, two rows per line. [2 L, 3]
            colors: RGB or RGBA in 0..1, one per vertex, or one for all. [2 L, 3 or 4] or [3 or 4]
            key: The same key as last time changes nothing; None always replaces.
        Returns:
            Whether anything was uploaded.
        Raises:
            ValueError: Shapes do not belong together.
        """
        if key is not None and key == self._key:
            return False
        vertices = np.asarray(vertices, dtype=np.float32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) % 2:
            raise ValueError(f"line vertices must be [2 L, 3], got {vertices.shape}")
        colors = np.broadcast_to(with_alpha(colors), (len(vertices), 4))
        lines = np.concatenate([vertices, colors], axis=1).reshape(-1, _FLOATS_PER_LINE)
        lines = lines[np.isfinite(lines).all(axis=1)]
        self._free_lines()
        self._n_lines = len(lines)
        self._key = key
        if self._n_lines:
            self._buffer = self._ctx.buffer(np.ascontiguousarray(lines).tobytes())
            layout = (self._buffer, "3f 4f 3f 4f/i", "start", "start_color", "end", "end_color")
            self._quads = self._ctx.vertex_array(self._program, [layout])
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
        width_px: float = 1.5,
        opacity: float = 1.0,
        is_depth_tested: bool = False,
    ) -> None:
        """Blend the lines over the contents of the target.

        Args:
            target: Where to; may differ in size from width x height.
            world_to_camera: Rigid map, OpenCV axes. [4, 4]
            K: Intrinsics in pixels of width x height. [3, 3]
            width: px.
            height: px.
            near: Lines are cut here, scene units.
            width_px: Of a line, target pixels.
            opacity: Multiplies the colours' alpha.
            is_depth_tested: Hide what lies behind depth already in the target, and write depth.
        """
        if self._quads is None:
            return
        target.use(moderngl.BLEND | (moderngl.DEPTH_TEST if is_depth_tested else moderngl.NOTHING))
        matrix = clip_matrix(world_to_camera, K, width, height, near=near)
        self._program["world_to_clip"].write(uniform_matrix(matrix))  # type: ignore[union-attr]
        self._program["size_px"] = target.size
        self._program["half_width_px"] = 0.5 * width_px
        self._program["opacity"] = opacity
        self._quads.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._n_lines)

    def release(self) -> None:
        """Free everything. The renderer cannot be used afterwards."""
        self._free_lines()
        self._program.release()

    def _free_lines(self) -> None:
        for thing in (self._quads, self._buffer):
            if thing is not None:
                thing.release()
        self._quads = self._buffer = None
        self._n_lines = 0
