"""Draws Gaussians as instanced quads with the projection and cut-offs of the trainer's rasterizer.

Equal to engine.raster up to float32 and three things: blending runs back to front, so the rasterizer's early stop at
TRANSMITTANCE_MIN does not exist here (it hides less than that share of a colour); the target's precision (16-bit floats
about 65 dB); and, during fast camera moves with very many rows, an order that is a frame or two old.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Protocol

import moderngl
import numpy as np

from app.background.latest import LatestWorker
from engine.conventions import ALPHA_MIN
from ui.gl.camera import NEAR, resized_K, uniform_matrix
from ui.gl.depth_order import DepthOrder, OrderKey, OrderRequest, depth_order
from ui.gl.shaders import load_program
from ui.gl.targets import Target

TEXELS_PER_SPLAT = 4
SPLATS_PER_ROW = 1024
"""64 bytes per splat in rows of 4096 texels: below every driver's texture limit up to 16 million splats."""
SORT_ON_THREAD_ABOVE = 100_000
"""Up to this many rows a sort takes about a millisecond, less than a stale order is worth."""


class SplatArrays(Protocol):
    """What can be drawn: the fields of engine.raster.Gaussians as numpy arrays, and a name for the contents.

    Attributes:
        means: Centres, world space, scene units. [N, 3]
        quats: Rotations wxyz, any non-zero length. [N, 4]
        scales: Standard deviations, scene units. [N, 3]
        opacities: In 0..1. [N]
        colors: Display-encoded RGB in 0..1. [N, 3]
        key: Differs whenever the arrays do; None when not known.
    """

    @property
    def means(self) -> np.ndarray: ...
    @property
    def quats(self) -> np.ndarray: ...
    @property
    def scales(self) -> np.ndarray: ...
    @property
    def opacities(self) -> np.ndarray: ...
    @property
    def colors(self) -> np.ndarray: ...
    @property
    def key(self) -> Hashable: ...


class SplatRenderer:
    """Draws one uploaded set of Gaussians. Owns its buffers, its program and the sorter.

    Args:
        ctx: Current context. All methods belong to its thread.
        sort_on_thread_above: With more rows than this, a moved camera is drawn in the last order until the new one is
            ready. Tests that compare pictures keep below it.
    """

    def __init__(self, ctx: moderngl.Context, *, sort_on_thread_above: int = SORT_ON_THREAD_ABOVE) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "splat")
        self._sorter: LatestWorker[OrderRequest, DepthOrder] = LatestWorker("splat-sorter", OrderRequest.answer)
        self._sort_on_thread_above = sort_on_thread_above
        self._texture: moderngl.Texture | None = None
        self._ids: moderngl.Buffer | None = None
        self._quads: moderngl.VertexArray | None = None
        self._means = np.zeros((0, 3), dtype=np.float32)
        self._key: Hashable = None
        self._revision = 0
        self._order: DepthOrder | None = None
        self._wanted_order: OrderKey | None = None
        self._n_dropped = 0

    def __len__(self) -> int:
        """Rows that can be seen."""
        return len(self._means)

    @property
    def key(self) -> Hashable:
        """Key of the last upload."""
        return self._key

    @property
    def n_dropped(self) -> int:
        """Rows of the last upload that were left out: not finite, no rotation, or too faint to pass ALPHA_MIN."""
        return self._n_dropped

    @property
    def is_order_stale(self) -> bool:
        """Was the last draw made in an order of another view? Then draw again soon."""
        return self._order is not None and self._order.key != self._wanted_order

    def upload(self, gaussians: SplatArrays) -> bool:
        """Take another set of Gaussians. Rows that are not finite are dropped and counted.

        Args:
            gaussians: Arrays, copied. The same key as last time uploads nothing; a key of None always uploads.
        Returns:
            Whether anything was uploaded.
        Raises:
            ValueError: Shapes do not belong together.
        """
        if gaussians.key is not None and gaussians.key == self._key:
            return False
        packed = pack_splats(gaussians)
        self._n_dropped = len(gaussians.means) - len(packed)
        self._means = np.ascontiguousarray(packed[:, 0:3])
        self._key = gaussians.key
        self._revision += 1  # the order of other rows means nothing for these
        self._order = None
        if len(packed):
            self._write_texture(packed)
        return True

    def draw(
        self, target: Target, world_to_camera: np.ndarray, K: np.ndarray, width: int, height: int, near: float = NEAR
    ) -> None:
        """Blend the Gaussians over what the target holds. They neither test nor write depth.

        Args:
            target: Where to. Its size may differ from width x height: the picture then fills it, with the low-pass of
                EPS2D_PX2 taken in its own pixels, as if rasterized at that size.
            world_to_camera: Rigid map, OpenCV axes. [4, 4]
            K: Intrinsics in pixels of width x height. Skew is not drawn, as in engine.raster. [3, 3]
            width: px.
            height: px.
            near: Centres whose camera z is not above this are not drawn, scene units.
        """
        world_to_camera = np.asarray(world_to_camera, dtype=np.float64)
        ids = self._ordered_ids(world_to_camera[2], near)
        if not len(ids) or self._texture is None or self._quads is None:
            return
        K = resized_K(K, (width, height), target.size)
        target.use(moderngl.BLEND)
        self._texture.use(0)
        self._program["splats"] = 0
        self._program["world_to_camera"].write(uniform_matrix(world_to_camera))  # type: ignore[union-attr]
        self._program["focal_px"] = (K[0, 0], K[1, 1])
        self._program["center_px"] = (K[0, 2], K[1, 2])
        self._program["size_px"] = target.size
        self._program["near"] = near
        self._quads.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(ids))

    def release(self) -> None:
        """Free everything and end the sorter's thread. The renderer cannot be used afterwards."""
        self._sorter.close()
        for thing in (self._quads, self._ids, self._texture, self._program):
            if thing is not None:
                thing.release()
        self._quads = self._ids = self._texture = None

    # ---- order -----------------------------------------------------------------------------------------------

    def _ordered_ids(self, view_row: np.ndarray, near: float) -> np.ndarray:
        """Row numbers to draw, in the buffer already when unchanged."""
        if not len(self._means):
            return np.zeros(0, dtype=np.uint32)
        # Only this row of the matrix decides the order: panning and rolling about the viewing axis need no sort.
        key = (self._revision, np.asarray(view_row, dtype=np.float64).tobytes(), near)
        if key != self._wanted_order:
            self._wanted_order = key
            if self._order is not None and len(self._means) > self._sort_on_thread_above:
                self._sorter.request(OrderRequest(key, self._means, np.array(view_row, np.float64), near))
            else:  # few rows, or rows without any order yet
                self._take_order(DepthOrder(key, depth_order(self._means, view_row, near)))
        if self.is_order_stale:
            failure, newest = self._sorter.take_error(), self._sorter.newest
            if failure is not None:
                raise failure[1]
            if newest is not None and newest[1] is not self._order and newest[1].key[0] == self._revision:
                self._take_order(newest[1])
        assert self._order is not None
        return self._order.ids

    def _take_order(self, order: DepthOrder) -> None:
        self._order = order
        n_bytes = max(order.ids.nbytes, 4)
        if self._ids is None or self._ids.size < n_bytes:
            if self._quads is not None:
                self._quads.release()
            if self._ids is not None:
                self._ids.release()
            self._ids = self._ctx.buffer(reserve=n_bytes * 3 // 2 // 4 * 4 + 4, dynamic=True)
            self._quads = self._ctx.vertex_array(self._program, [(self._ids, "1u/i", "splat_id")])
        else:
            self._ids.orphan()  # a draw that still reads the old order keeps its own memory
        if len(order.ids):
            self._ids.write(order.ids.tobytes())

    # ---- data ------------------------------------------------------------------------------------------------

    def _write_texture(self, packed: np.ndarray) -> None:
        rows = -(-len(packed) // SPLATS_PER_ROW)
        if self._texture is None or self._texture.height < rows:
            if self._texture is not None:
                self._texture.release()
            size = (SPLATS_PER_ROW * TEXELS_PER_SPLAT, rows + rows // 4)
            self._texture = self._ctx.texture(size, 4, dtype="f4")
            self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        padded = np.zeros((rows * SPLATS_PER_ROW, packed.shape[1]), dtype=np.float32)
        padded[: len(packed)] = packed
        self._texture.write(padded.tobytes(), viewport=(0, 0, self._texture.width, rows))


def pack_splats(gaussians: SplatArrays) -> np.ndarray:
    """Rows that can be seen, as the four texels per splat the shader reads.

    Returns:
        mean, opacity | quat wxyz | scale, 0 | color, 0. [n, 16] float32, n <= N in the given order
    Raises:
        ValueError: Shapes do not belong together.
    """
    n = len(gaussians.means)
    expected = {"means": (n, 3), "quats": (n, 4), "scales": (n, 3), "opacities": (n,), "colors": (n, 3)}
    for name, shape in expected.items():
        if np.shape(getattr(gaussians, name)) != shape:
            raise ValueError(f"{name} must have shape {shape}, got {np.shape(getattr(gaussians, name))}")
    packed = np.zeros((n, 16), dtype=np.float32)
    packed[:, 0:3] = gaussians.means
    packed[:, 3] = gaussians.opacities
    packed[:, 4:8] = gaussians.quats
    packed[:, 8:11] = gaussians.scales
    packed[:, 12:15] = gaussians.colors
    is_seen = np.isfinite(packed).all(axis=1) & (packed[:, 3] > ALPHA_MIN) & packed[:, 4:8].any(axis=1)
    return packed if is_seen.all() else packed[is_seen]
