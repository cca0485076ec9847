"""Pictures on the GPU, and the quad that draws one into a target."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ui.gl.changes import note_change
from ui.gl.shaders import load_program

if TYPE_CHECKING:
    from ui.gl.targets import Target


@dataclass(frozen=True, slots=True)
class PixelRect:
    """A rectangle in pixels of a target, y down, from (x0, y0) to (x1, y1)."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        """In px."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """In px."""
        return self.y1 - self.y0


def fit_rect(image_size: tuple[int, int], target_size: tuple[int, int]) -> PixelRect:
    """The largest centred rectangle of the image's aspect inside the target.

    Args:
        image_size: Width and height, px.
        target_size: Width and height, px.
    """
    scale = min(target_size[0] / image_size[0], target_size[1] / image_size[1])
    width, height = image_size[0] * scale, image_size[1] * scale
    x0, y0 = (target_size[0] - width) / 2, (target_size[1] - height) / 2
    return PixelRect(x0, y0, x0 + width, y0 + height)


class ImageTexture:
    """One 8-bit RGB picture on the GPU, top row first. Owns its texture.

    Args:
        ctx: Current context. All methods belong to its thread.
        is_smooth: Interpolate between pixels; False shows them as squares.
    """

    def __init__(self, ctx: moderngl.Context, *, is_smooth: bool = True) -> None:
        self._ctx = ctx
        self._is_smooth = is_smooth
        self._filter = moderngl.LINEAR if is_smooth else moderngl.NEAREST
        self._texture: moderngl.Texture | None = None
        self._key: Hashable = None

    @property
    def texture(self) -> moderngl.Texture:
        """For `imgui.ImTextureRef(image.texture.glo)`, upright with the default uv.

        Raises:
            RuntimeError: Nothing was set yet.
        """
        if self._texture is None:
            raise RuntimeError("ImageTexture.texture asked for before set()")
        return self._texture

    @property
    def key(self) -> Hashable:
        """Key of the last picture; None when not known."""
        return self._key

    @property
    def is_empty(self) -> bool:
        """Was nothing set yet?"""
        return self._texture is None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px; (0, 0) before the first set()."""
        return (0, 0) if self._texture is None else (self._texture.width, self._texture.height)

    def set(self, image: np.ndarray, *, key: Hashable = None) -> bool:
        """Upload a picture.

        Args:
            image: RGB, top row first. [H, W, 3] uint8
            key: Contents of the picture. The same key as last time uploads nothing; None always uploads.
        Returns:
            Whether anything was uploaded.
        Raises:
            ValueError: Wrong shape or type, or no pixels.
        """
        if key is not None and key == self._key:
            return False
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise ValueError(f"a picture must be [H, W, 3] uint8 with pixels, got {image.shape} {image.dtype}")
        height, width = image.shape[:2]
        if self._texture is None or self.size != (width, height):
            self.release()
            self._texture = self._ctx.texture((width, height), 3, alignment=1)
            self._texture.filter = (self._filter, self._filter)
            self._texture.repeat_x = self._texture.repeat_y = False
        self._texture.write(np.ascontiguousarray(image), alignment=1)
        self._key = key
        note_change()
        return True

    def fit(self, shown_size: tuple[int, int]) -> None:
        """Say in which size it is shown. Pixel for pixel nothing is interpolated, which takes a third of the time where
        the processor draws.

        Args:
            shown_size: Width and height, px.
        """
        is_smooth = self._is_smooth and shown_size != self.size
        if self._texture is not None:
            kind = moderngl.LINEAR if is_smooth else moderngl.NEAREST
            self._texture.filter = (kind, kind)

    def release(self) -> None:
        """Free the texture. set() may follow."""
        if self._texture is not None:
            self._texture.release()
            self._texture = None
        self._key = None


class ImagePainter:
    """Draws pictures into targets. Owns one program and no picture."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._program = load_program(ctx, "image")
        self._quad = ctx.vertex_array(self._program, [])

    def draw(self, target: Target, image: ImageTexture, rect: PixelRect | None = None) -> None:
        """Draw an opaque picture.

        Args:
            target: Where to.
            image: Holds a picture.
            rect: Where in the target; the whole of it by default.
        """
        width, height = target.size
        rect = rect or PixelRect(0, 0, width, height)
        target.use(moderngl.NOTHING)
        image.texture.use(0)
        self._program["image"] = 0
        self._program["rect_ndc"] = (
            2 * rect.x0 / width - 1,
            2 * rect.y0 / height - 1,
            2 * rect.x1 / width - 1,
            2 * rect.y1 / height - 1,
        )
        self._quad.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def release(self) -> None:
        """Free the program."""
        self._quad.release()
        self._program.release()
