"""Small pictures from cameras, kept on the GPU as long as they are looked at."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from ui.gl import ImageTexture
from ui.panels.state import Rect, UiState
from ui.style import theme
from ui.style.theme import Icon

WIDTH_PX = 160
MOST = 256
ASK_AGAIN_S = 0.1


class Thumbnails:
    """Owns textures. GL thread only.

    Args:
        make_texture: Makes an empty texture.
        width_px: So wide are the pictures.
        most: So many are kept; the one that was not drawn for longest goes first.

    Attributes:
        is_waiting: Is one that was drawn in this frame still to come?
    """

    def __init__(self, make_texture: Callable[[], ImageTexture], *, width_px: int = WIDTH_PX, most: int = MOST) -> None:
        self._make_texture = make_texture
        self._width_px, self._most = width_px, most
        self._textures: OrderedDict[tuple[int, int], ImageTexture] = OrderedDict()
        self.is_waiting = False

    def begin(self) -> None:
        """A frame begins."""
        self.is_waiting = False

    def release(self) -> None:
        """Free all of them, as when another capture was opened."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()

    def draw(self, session: SessionView, camera_index: int, frame_index: int, box: Rect, ui: UiState) -> None:
        """Draw a camera's picture into a box, cut to its shape; a camera's sign until it is there."""
        texture = self._get(session, camera_index, frame_index, ui)
        draw = imgui.get_window_draw_list()
        if texture is None:
            draw.add_rect_filled(box.low, box.high, theme.u32(theme.BACKDROP), 3)
            draw.add_text(ImVec2(box.x0 + 24, box.y0 + 12), theme.u32(theme.OUTLINE), Icon.CAMERA)
            return
        low, high = crop_to(texture.size[0] / max(texture.size[1], 1), box.width / box.height)
        white = theme.u32(theme.rgb(255, 255, 255))
        draw.add_image_rounded(imgui.ImTextureRef(texture.texture.glo), box.low, box.high, low, high, white, 3)

    def _get(self, session: SessionView, camera_index: int, frame_index: int, ui: UiState) -> ImageTexture | None:
        key = (camera_index, frame_index)
        known = self._textures.get(key)
        if known is not None:
            self._textures.move_to_end(key)
            return known
        if self.is_waiting:  # one at a time, so that decoding never crowds out the viewport
            return None
        picture = session.ground_truth(camera_index, frame_index, self._width_px)
        self.is_waiting = True
        ui.redraw_within(ASK_AGAIN_S)
        if picture is None or picture.source.frame_index not in (None, frame_index):
            return None
        texture = self._make_texture()
        texture.set(picture.image)
        self._textures[key] = texture
        while len(self._textures) > self._most:
            self._textures.popitem(last=False)[1].release()
        return texture


def crop_to(image_aspect: float, box_aspect: float) -> tuple[ImVec2, ImVec2]:
    """Texture corners of the largest centred part of an image that fills a box without stretching."""
    share_x = min(box_aspect / image_aspect, 1.0)
    share_y = min(image_aspect / box_aspect, 1.0)
    return ImVec2(0.5 - share_x / 2, 0.5 - share_y / 2), ImVec2(0.5 + share_x / 2, 0.5 + share_y / 2)
