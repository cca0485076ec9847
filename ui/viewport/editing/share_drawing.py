"""ShareDrawing: where some Gaussians are seen, as a line around that, with stripes or without."""

from __future__ import annotations

import moderngl
import numpy as np

from ui.gl import Target
from ui.gl.shaders import load_program
from ui.style.colors import Color


class ShareDrawing:
    """Owns the GL objects. GL thread only."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program: moderngl.Program | None = None
        self._quad: moderngl.VertexArray | None = None
        self._texture: moderngl.Texture | None = None
        self._share: np.ndarray | None = None

    def release(self) -> None:
        """Free every GL object."""
        for thing in (self._quad, self._program, self._texture):
            if thing is not None:
                thing.release()
        self._quad = self._program = self._texture = self._share = None

    @property
    def key(self) -> int:
        """Differs whenever something else is drawn."""
        return id(self._share)

    def take(self, share: np.ndarray) -> None:
        """Take up something to draw. share: See engine.editing.selection.share. [h, w] float32"""
        if share is self._share:
            return
        height, width = share.shape
        if self._texture is None or self._texture.size != (width, height):
            if self._texture is not None:
                self._texture.release()
            self._texture = self._ctx.texture((width, height), 1, dtype="f4")
            self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._texture.repeat_x = self._texture.repeat_y = False
        self._texture.write(np.ascontiguousarray(share))
        self._share = share

    def draw(self, target: Target, hue: Color, pixels_per_unit: float, *, is_filled: bool) -> None:
        """Draw over the contents of the target. is_filled: Whether there are stripes inside of the line."""
        if self._texture is None:
            return
        if self._program is None:
            self._program = load_program(self._ctx, "selection")
            self._quad = self._ctx.vertex_array(self._program, [])
        assert self._quad is not None
        target.use(moderngl.BLEND)
        self._texture.use(0)
        self._program["share"] = 0
        self._program["size_px"] = target.size
        self._program["unit_px"] = pixels_per_unit
        self._program["hue"] = hue[:3]
        self._program["fill"] = float(is_filled)
        self._quad.render(moderngl.TRIANGLE_STRIP, vertices=4)
