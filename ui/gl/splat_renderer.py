"""Draws Gaussians as instanced quads with the projection and cut-offs of the trainer's rasterizer.

Equal to engine.raster up to float32 and three things: blending runs back to front, so the rasterizer's early stop at
TRANSMITTANCE_MIN does not exist here (it hides less than that share of a colour); the target's precision (16-bit floats
about 65 dB); and, while the camera moves with many rows, an order that is a frame or two old.

Many rows are packed and sorted on a thread. Other Gaussians are drawn once they are sorted, the last ones until then:
rows and order always belong together.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

import moderngl
import numpy as np

from app.background.latest import LatestWorker
from ui.gl.camera import NEAR, resized_K, uniform_matrix
from ui.gl.depth_order import DepthOrder, OrderKey, OrderRequest, depth_order
from ui.gl.shaders import load_program
from ui.gl.splat_rows import PackedSplats, SplatArrays, pack_splats
from ui.gl.splat_textures import COLORS, GEOMETRY, SplatTextures
from ui.gl.targets import Target

ON_THREAD_ABOVE = 20_000
"""Up to this many rows are packed and sorted in about a millisecond, less than a late picture is worth."""
NEW_ROWS, NEW_ORDER = "rows", "order"
"""Lanes of the sorter."""


@dataclass(frozen=True, slots=True)
class RowsRequest:
    """Other Gaussians, to be packed and put in order.

    Attributes:
        key: Of the Gaussians.
        before: See ui.gl.splat_rows.pack_splats.
        view_row, near: Of the last draw; see ui.gl.depth_order.
    """

    key: Hashable
    arrays: SplatArrays = field(compare=False)
    before: PackedSplats = field(compare=False)
    view_row: np.ndarray = field(compare=False)
    near: float = field(compare=False)

    def answer(self) -> tuple[PackedSplats, np.ndarray]:
        """Rows, and their order."""
        packed = pack_splats(self.arrays, self.before)
        return packed, depth_order(packed.means, self.view_row, self.near)


class SplatRenderer:
    """Draws one set of Gaussians. Owns its buffers, its program and the sorter.

    Args:
        ctx: Current context. All methods belong to its thread.
        on_thread_above: With more rows than this, other Gaussians and a moved camera wait for the thread, and the last
            ones are drawn meanwhile. Tests that compare pictures keep below it.
    """

    def __init__(self, ctx: moderngl.Context, *, on_thread_above: int = ON_THREAD_ABOVE) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "splat")
        self._sorter: LatestWorker[RowsRequest | OrderRequest, object] = LatestWorker(
            "splat-sorter", lambda request: request.answer()
        )
        self._on_thread_above = on_thread_above
        self._textures = SplatTextures(ctx)
        self._ids: moderngl.Buffer | None = None
        self._quads: moderngl.VertexArray | None = None
        self._packed: PackedSplats | None = None
        self._coming: RowsRequest | None = None
        self._key: Hashable = None
        self._revision = 0
        self._order: DepthOrder | None = None
        self._wanted_order: OrderKey | None = None
        self._view: tuple[np.ndarray, float] | None = None

    def __len__(self) -> int:
        """Rows that can be seen."""
        return 0 if self._packed is None else len(self._packed)

    @property
    def key(self) -> Hashable:
        """Key of the last upload."""
        return self._key

    @property
    def drawn(self) -> SplatArrays | None:
        """The Gaussians that are drawn: those of the last upload, or the ones before until those are ready."""
        return None if self._packed is None else self._packed.arrays

    @property
    def textures(self) -> SplatTextures:
        """Where the rows are."""
        return self._textures

    @property
    def n_dropped(self) -> int:
        """Rows left out of the drawing: not finite, no rotation, or too faint to pass ALPHA_MIN."""
        return 0 if self._packed is None else self._packed.n_dropped

    @property
    def is_order_stale(self) -> bool:
        """Was the last draw made in an order of another view, or of other Gaussians than uploaded? Draw again soon."""
        return self._coming is not None or (self._order is not None and self._order.key != self._wanted_order)

    @property
    def has_news(self) -> bool:
        """Is there something that the last draw waited for?"""
        lane = NEW_ROWS if self._coming is not None else NEW_ORDER
        wanted = self._coming if self._coming is not None else self._wanted_order
        newest = self._sorter.newest_in(lane)
        return self.is_order_stale and newest is not None and wanted in (newest[0], newest[0].key)

    def upload(self, gaussians: SplatArrays, *, at_once: bool = False) -> bool:
        """Take another set of Gaussians. Rows that are not finite are dropped and counted.

        Args:
            gaussians: Arrays, which must not change afterwards. The same key as last time uploads nothing; a key of
                None always uploads.
            at_once: Do not wait for the thread: the present picture must no longer be seen.
        Returns:
            Whether it was another one.
        Raises:
            ValueError: Shapes do not belong together.
        """
        if gaussians.key is not None and gaussians.key == self._key:
            return False
        self._key = gaussians.key
        is_many = len(gaussians.means) > self._on_thread_above
        if not is_many or at_once or self._packed is None or self._view is None or gaussians.key is None:
            self._coming = None
            self._take_rows(pack_splats(gaussians, self._packed))
        else:
            self._coming = RowsRequest(gaussians.key, gaussians, self._packed, *self._view)
            self._sorter.request(self._coming, lane=NEW_ROWS)
        return True

    def update(self) -> None:
        """Take up the rows packed and sorted on the thread. `draw` does that too."""
        failure = self._sorter.take_error()
        if failure is not None:
            raise failure[1]
        coming = self._coming
        newest = None if coming is None else self._sorter.newest_in(NEW_ROWS)
        if coming is None or newest is None or newest[0] != coming:
            return
        packed, ids = newest[1]  # pyright: ignore[reportGeneralTypeIssues] - of a RowsRequest
        self._coming = None
        self._take_rows(packed)
        self._take_order(DepthOrder(self._order_key(coming.view_row, coming.near), ids))

    def draw(
        self, target: Target, world_to_camera: np.ndarray, K: np.ndarray, width: int, height: int, near: float = NEAR
    ) -> None:
        """Blend the Gaussians over the contents of the target. They neither test nor write depth.

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
        self._view = np.array(world_to_camera[2], np.float32), near
        self.update()
        ids = self._ordered_ids(*self._view)
        if not len(ids) or self._quads is None:
            return
        K = resized_K(K, (width, height), target.size)
        target.use(moderngl.BLEND)
        self._textures.use()
        self._program["geometry"] = GEOMETRY
        self._program["colors"] = COLORS
        self._program["world_to_camera"].write(uniform_matrix(world_to_camera))  # type: ignore[union-attr]
        self._program["focal_px"] = (K[0, 0], K[1, 1])
        self._program["center_px"] = (K[0, 2], K[1, 2])
        self._program["size_px"] = target.size
        self._program["near"] = near
        self._quads.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(ids))

    def release(self) -> None:
        """Free everything and end the sorter's thread. The renderer cannot be used afterwards."""
        self._sorter.close()
        self._textures.release()
        for thing in (self._quads, self._ids, self._program):
            if thing is not None:
                thing.release()
        self._quads = self._ids = self._packed = None

    # ---- rows and their order --------------------------------------------------------------------------------

    def _take_rows(self, packed: PackedSplats) -> None:
        self._packed = packed
        self._revision += 1  # the order of other rows means nothing for these
        self._order = None
        if len(packed):
            self._textures.write(packed)

    def _order_key(self, view_row: np.ndarray, near: float) -> OrderKey:
        """Only this row of the matrix decides the order: panning and rolling about the viewing axis need no sort."""
        return self._revision, view_row.tobytes(), near

    def _ordered_ids(self, view_row: np.ndarray, near: float) -> np.ndarray:
        """Row numbers to draw, in the buffer already when unchanged."""
        if self._packed is None or not len(self._packed):
            return np.zeros(0, dtype=np.uint32)
        means, key = self._packed.means, self._order_key(view_row, near)
        if key != self._wanted_order:
            self._wanted_order = key
            is_there = self._order is not None and self._order.key == key
            if not is_there and self._order is not None and len(means) > self._on_thread_above:
                self._sorter.request(OrderRequest(key, means, view_row, near), lane=NEW_ORDER)
            elif not is_there:  # few rows, or rows without any order yet
                self._take_order(DepthOrder(key, depth_order(means, view_row, near)))
        assert self._order is not None
        if self._order.key != key:
            newest = self._sorter.newest_in(NEW_ORDER)
            order = None if newest is None else newest[1]
            if isinstance(order, DepthOrder) and order is not self._order and order.key[0] == self._revision:
                self._take_order(order)
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
