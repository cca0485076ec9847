"""The textures that splats are read from. Rows are written when they differ from those that are there."""

from __future__ import annotations

from collections.abc import Hashable

import moderngl
import numpy as np

from ui.gl.splat_rows import SPLATS_PER_ROW, PackedSplats, SplatRows

GEOMETRY_TEXELS = 3
GEOMETRY, COLORS = 0, 1
"""Texture units."""


class SplatTextures:
    """Shapes and places in one texture, colours in another. Owns both; all methods belong to the context's thread.

    Attributes:
        n_geometry_written, n_colors_written: Splats of the last `write` whose shapes and whose colours were written.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._geometry: moderngl.Texture | None = None
        self._colors: moderngl.Texture | None = None
        self._still_key: Hashable = None
        self._still_colors: np.ndarray | None = None
        self.n_geometry_written = self.n_colors_written = 0

    def write(self, packed: PackedSplats) -> None:
        """Take these; of rows that stand still only what is not there yet."""
        self.n_geometry_written = self.n_colors_written = 0
        self._hold(packed.first_moving_row + -(-len(packed.moving) // SPLATS_PER_ROW))
        still, moving = packed.still, packed.moving
        if packed.still_key is None or packed.still_key != self._still_key:
            self._write_geometry(still, 0)
        if packed.still_key is None or self._still_colors is not still.colors:
            self._write_colors(still, 0)
        self._still_key, self._still_colors = packed.still_key, still.colors
        self._write_geometry(moving, packed.first_moving_row)
        self._write_colors(moving, packed.first_moving_row)

    def use(self) -> None:
        """Bind both to their units."""
        assert self._geometry is not None, "nothing was written yet"
        assert self._colors is not None, "nothing was written yet"
        self._geometry.use(GEOMETRY)
        self._colors.use(COLORS)

    def release(self) -> None:
        """Free both. write() may follow."""
        for texture in (self._geometry, self._colors):
            if texture is not None:
                texture.release()
        self._geometry = self._colors = None
        self._still_key = self._still_colors = None

    def _hold(self, n_rows: int) -> None:
        """Make room; earlier contents are gone if it was too small."""
        if self._geometry is not None and self._geometry.height >= n_rows:
            return
        self.release()
        height = max(n_rows + n_rows // 4, 1)
        self._geometry = self._ctx.texture((SPLATS_PER_ROW * GEOMETRY_TEXELS, height), 4, dtype="f4")
        self._colors = self._ctx.texture((SPLATS_PER_ROW, height), 4, dtype="f4")
        for texture in (self._geometry, self._colors):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def _write_geometry(self, rows: SplatRows, first_row: int) -> None:
        assert self._geometry is not None
        _write(self._geometry, rows.geometry, first_row)
        self.n_geometry_written += len(rows)

    def _write_colors(self, rows: SplatRows, first_row: int) -> None:
        assert self._colors is not None
        _write(self._colors, rows.colors, first_row)
        self.n_colors_written += len(rows)


def _write(texture: moderngl.Texture, values: np.ndarray, first_row: int) -> None:
    """Whole rows of the texture at once, then the rest of the last one."""
    n_full, n_left = divmod(len(values), SPLATS_PER_ROW)
    texels = texture.width // SPLATS_PER_ROW
    if n_full:
        whole = np.ascontiguousarray(values[: n_full * SPLATS_PER_ROW])
        texture.write(whole, viewport=(0, first_row, texture.width, n_full))
    if n_left:
        rest = np.ascontiguousarray(values[n_full * SPLATS_PER_ROW :])
        texture.write(rest, viewport=(0, first_row + n_full, n_left * texels, 1))
