"""Where scenes are drawn: a floating-point picture with depth, resolved to 8 bits for ImGui.

Colours are display-encoded and premultiplied by alpha; blending is linear in them, as it is in the trainer. Half floats
are for display; checks against the rasterizer want 32-bit floats, because many faint layers drift in 16 bits.
"""

from __future__ import annotations

from typing import Literal

import moderngl

from ui.gl.changes import note_change
from ui.gl.image import ImagePainter, ImageTexture, PixelRect
from ui.gl.shaders import load_program

Precision = Literal["f1", "f2", "f4"]
BLACK = (0.0, 0.0, 0.0)


class Target:
    """A resizable off-screen picture. Owns its textures; row 0 is the top row everywhere.

    Args:
        ctx: Current context. All methods belong to its thread.
        size: Width and height, px.
        precision: "f2" for RGBA16F (display), "f4" for RGBA32F (checks), "f1" for 8 bits that are shown as they are:
            cleared to the background, nothing to resolve. Good for a few marks over a picture, not for many faint
            layers, and one pass over all pixels less.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int] = (16, 16), *, precision: Precision = "f2") -> None:
        self._ctx = ctx
        self._precision = precision
        self._size = (0, 0)
        self._color: moderngl.Texture | None = None
        self._depth: moderngl.Renderbuffer | None = None
        self._framebuffer: moderngl.Framebuffer | None = None
        self._resolved: moderngl.Texture | None = None
        self._resolved_framebuffer: moderngl.Framebuffer | None = None
        self._painter: ImagePainter | None = None
        self._program = load_program(ctx, "resolve")
        self._quad = ctx.vertex_array(self._program, [])
        self.resize(*size)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self._size

    @property
    def is_direct(self) -> bool:
        """Is the drawing shown as it is?"""
        return self._precision == "f1"

    @property
    def framebuffer(self) -> moderngl.Framebuffer:
        """The texture drawn into: premultiplied colour and depth. Replaced by resize()."""
        assert self._framebuffer is not None, "the target was released"
        return self._framebuffer

    @property
    def texture(self) -> moderngl.Texture:
        """The 8-bit picture of the last resolve(), upright with ImGui's default uv. Replaced by resize()."""
        shown = self._color if self.is_direct else self._resolved
        assert shown is not None, "the target was released"
        return shown

    def resize(self, width: int, height: int) -> bool:
        """Take another size; contents are lost (cleared) when it differs.

        Returns:
            Whether the size changed, so that everything has to be drawn again.
        Raises:
            ValueError: A size is not positive.
        """
        if width <= 0 or height <= 0:
            raise ValueError(f"a target needs a positive size, got {width} x {height}")
        if (width, height) == self._size:
            return False
        self._release_pictures()
        self._size = (width, height)
        self._color = self._ctx.texture(self._size, 4, dtype=self._precision)
        self._color.filter = (
            (moderngl.LINEAR, moderngl.LINEAR) if self.is_direct else (moderngl.NEAREST, moderngl.NEAREST)
        )
        self._color.repeat_x = self._color.repeat_y = False
        self._depth = self._ctx.depth_renderbuffer(self._size)
        self._framebuffer = self._ctx.framebuffer([self._color], self._depth)
        if not self.is_direct:
            self._resolved = self._ctx.texture(self._size, 4)
            self._resolved.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._resolved.repeat_x = self._resolved.repeat_y = False
            self._resolved_framebuffer = self._ctx.framebuffer([self._resolved])
        self.clear()
        self.resolve()
        return True

    def use(self, flags: int = moderngl.NOTHING) -> None:
        """Make it what GL draws into, with the viewport over all of it and no state left over from others.

        Args:
            flags: Everything to enable, such as moderngl.BLEND, which then blends premultiplied colours over.
        """
        self._bind(self.framebuffer, flags)
        if flags & moderngl.BLEND:
            # Both are write-only in moderngl, and its type stubs want the pair of colour and alpha.
            self._ctx.blend_equation = moderngl.FUNC_ADD, moderngl.FUNC_ADD
            self._ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA

    def clear(self, background: tuple[float, float, float] = BLACK) -> None:
        """Nothing drawn, and far depth: transparent black, or the background where nothing is resolved later."""
        if self.is_direct:
            self.framebuffer.clear(*background, 1.0, depth=1.0)
        else:
            self.framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)

    def draw_image(self, image: ImageTexture, rect: PixelRect | None = None) -> None:
        """Draw an opaque picture, such as one from the CPU rasterizer, to draw overlays on top of.

        Args:
            image: Holds a picture.
            rect: Where, px; the whole target by default. See ui.gl.image.fit_rect.
        """
        if self._painter is None:
            self._painter = ImagePainter(self._ctx)
        self._painter.draw(self, image, rect)

    def resolve(self, background: tuple[float, float, float] | None = BLACK) -> moderngl.Texture:
        """Put the drawing over a background and round it to 8 bits; a direct target has that behind it already.

        Args:
            background: Display-encoded RGB in 0..1. None keeps the picture transparent, with colours not multiplied by
                alpha, which is how ImGui blends: for overlays shown over another texture.
        Returns:
            The RGBA8 picture, also at `texture`; opaque unless background is None.
        """
        note_change()
        if self.is_direct:
            return self.texture
        assert self._color is not None, "the target was released"
        assert self._resolved_framebuffer is not None, "the target was released"
        self._bind(self._resolved_framebuffer, moderngl.NOTHING)
        self._color.use(0)
        self._program["picture"] = 0
        self._program["background"] = background or BLACK
        self._program["is_transparent"] = background is None
        self._quad.render(moderngl.TRIANGLE_STRIP, vertices=4)
        return self.texture

    def release(self) -> None:
        """Free everything. The target cannot be used afterwards."""
        self._release_pictures()
        self._size = (0, 0)
        if self._painter is not None:
            self._painter.release()
            self._painter = None
        self._quad.release()
        self._program.release()

    def _bind(self, framebuffer: moderngl.Framebuffer, flags: int) -> None:
        framebuffer.use()
        self._ctx.viewport = (0, 0, self._size[0], self._size[1])
        self._ctx.enable_only(flags)

    def _release_pictures(self) -> None:
        if self._framebuffer is not None:
            # moderngl remembers the framebuffer in use and binds it again later: a GL error once it is deleted.
            self._ctx.detect_framebuffer(0).use()
        owned = (self._framebuffer, self._color, self._depth, self._resolved_framebuffer, self._resolved)
        for thing in owned:
            if thing is not None:
                thing.release()
        self._framebuffer = self._resolved_framebuffer = None
        self._color = self._resolved = self._depth = None
