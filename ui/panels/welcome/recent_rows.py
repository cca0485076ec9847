"""Projects that were opened lately, as rows of the first screen: a small picture, the name, how far it is trained,
where it lies, when it was open.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.playback.modes.arrays import Picture
from app.project.recents import RecentProject
from app.session.projects.project_commands import ForgetRecent, OpenCapture, OpenProject
from app.session.session_view import RecentView
from engine.text import one_line
from ui.gl import ImageTexture
from ui.panels.pieces.widgets import elided, elided_path
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.ago import ago_text
from ui.style.theme import Icon

ROW_HEIGHT, PICTURE_WIDTH, PADDING = 62.0, 96.0, 4.0
BUTTON = 28.0


def open_recent(entry: RecentProject) -> OpenProject | OpenCapture:
    """The command that opens an entry of the list of recent projects."""
    return OpenProject(entry.folder) if entry.project else OpenCapture(entry.folder, is_asking=True)


class RecentRows:
    """Draws the rows; owns the textures of their pictures. GL thread only.

    Args:
        make_texture: Makes an empty texture.
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._make_texture = make_texture
        self._textures: dict[Path, ImageTexture] = {}

    def release(self) -> None:
        """Free the pictures."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()

    def draw(self, recent: RecentView, dispatch: Dispatch, ui: UiState) -> None:
        """One row per project: Enter or a click opens it, the cross takes it out of the list."""
        for index, entry in enumerate(recent.entries):
            imgui.push_id(index)
            self._draw_row(index, entry, recent, dispatch, ui)
            imgui.pop_id()

    def _draw_row(self, index: int, entry: RecentProject, recent: RecentView, dispatch: Dispatch, ui: UiState) -> None:
        is_gone = entry.folder in recent.missing
        start, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x - BUTTON - 6
        flags = imgui.SelectableFlags_.disabled if is_gone else imgui.SelectableFlags_.none
        if imgui.selectable("##recent", False, flags, ImVec2(width, ROW_HEIGHT))[0]:
            dispatch(open_recent(entry))
        ui.mark(f"welcome.recent{index}")
        if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            state = "The folder no longer exists." if is_gone else entry.trained_text
            imgui.set_tooltip(f"{one_line(str(entry.folder))}\n{state}")
        imgui.same_line(0, 6)
        imgui.set_cursor_screen_pos(ImVec2(start.x + width + 6, start.y + (ROW_HEIGHT - BUTTON) / 2))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
        is_forgotten = imgui.button(f"{Icon.CLOSE}##forget", ImVec2(BUTTON, BUTTON))
        imgui.pop_style_var()
        if is_forgotten:
            dispatch(ForgetRecent(entry.folder))
        ui.mark(f"welcome.forget{index}")
        imgui.set_item_tooltip("Remove it from this list; its files stay")
        imgui.set_cursor_screen_pos(ImVec2(start.x, start.y + ROW_HEIGHT + 4))
        imgui.dummy(ImVec2(0, 0))
        self._draw_inside(entry, recent, ui, Rect(start.x, start.y, start.x + width, start.y + ROW_HEIGHT))

    def _draw_inside(self, entry: RecentProject, recent: RecentView, ui: UiState, row: Rect) -> None:
        is_gone = entry.folder in recent.missing
        draw, dim = imgui.get_window_draw_list(), theme.u32(theme.TEXT_DIM)
        x = row.x0 + PADDING
        if row.width > 3 * PICTURE_WIDTH:
            box = Rect(x, row.y0 + PADDING, x + PICTURE_WIDTH, row.y1 - PADDING)
            self._draw_picture(recent.pictures.found.get(entry.folder), entry.folder, box)
            x = box.x1 + 12
        room = row.x1 - x - 6
        name = elided(one_line(entry.name), room)
        draw.add_text(ImVec2(x, row.y0 + 5), dim if is_gone else theme.u32(theme.TEXT), name)
        state = f"{Icon.WARNING}  not found" if is_gone else entry.trained_text
        color = theme.u32(theme.ORANGE) if is_gone else dim
        when = ago_text(entry.opened, datetime.now(UTC))
        words = elided(f"{state}  -  {when}" if when else state, room)
        draw.add_text(ImVec2(x, row.y0 + 23), color, words)
        imgui.push_font(None, ui.fonts.small_size)
        path = elided_path(one_line(str(entry.folder)), room)
        draw.add_text(ImVec2(x, row.y0 + 42), dim, path)
        imgui.pop_font()

    def _draw_picture(self, picture: Picture | None, folder: Path, box: Rect) -> None:
        """A small picture; a sign in its place where there is none."""
        draw = imgui.get_window_draw_list()
        if picture is None:
            draw.add_rect_filled(box.low, box.high, theme.u32(theme.BACKDROP), 3)
            size = imgui.calc_text_size(Icon.FILM)
            x, y = box.center
            draw.add_text(ImVec2(x - size.x / 2, y - size.y / 2), theme.u32(theme.OUTLINE), Icon.FILM)
            return
        texture = self._textures.get(folder)
        if texture is None:
            texture = self._textures[folder] = self._make_texture()
        texture.set(picture.image, key=(folder, id(picture)))
        white = theme.u32(theme.rgb(255, 255, 255))
        corner = ImVec2(0, 0), ImVec2(1, 1)
        draw.add_image_rounded(imgui.ImTextureRef(texture.texture.glo), box.low, box.high, *corner, white, 3)
