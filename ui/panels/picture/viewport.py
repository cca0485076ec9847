"""The viewport: toolbar, strip of tools, and one, two or four pictures of the same frame, each from its own view."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from app.session.showing.look_commands import ActivateView
from ui.panels.guard import Guard, draw_failed
from ui.panels.picture.hud import Hud
from ui.panels.picture.panes import view_areas
from ui.panels.picture.picture_pane import PicturePane
from ui.panels.picture.tool_strip import STRIP_WIDTH, draw_tool_strip
from ui.panels.picture.toolbar.navigation import ViewPopup
from ui.panels.picture.toolbar.toolbar import TOOLBAR_HEIGHT, draw_toolbar
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.welcome.recent_rows import RecentRows
from ui.panels.welcome.welcome import draw_welcome
from ui.style import theme
from ui.viewport.scene import ViewportScene

SMALLEST_PICTURE = 32.0
"""With less room than this, there is nothing to draw."""


class ViewportPanel:
    """Owns the pictures. Those of views that are not shown keep what they hold until the window closes.

    Args:
        make_pane: Makes what one view is drawn with. GL thread only.
        guard: Keeps the other views where one cannot be drawn.
    """

    def __init__(self, make_pane: Callable[[], PicturePane], recent_rows: RecentRows, guard: Guard) -> None:
        self.recent_rows = recent_rows
        self._guard = guard
        self._make_pane = make_pane
        self._panes = [make_pane()]
        self._active = 0
        self._view_popup = ViewPopup()

    def release(self) -> None:
        """Free GL objects. GL thread only."""
        for pane in self._panes:
            pane.release()
        self.recent_rows.release()

    @property
    def active(self) -> PicturePane:
        """The picture of the active view, as of the last draw."""
        return self._panes[self._active]

    @property
    def panes(self) -> list[PicturePane]:
        """All pictures that were made, in the order of their views."""
        return self._panes

    @property
    def scene(self) -> ViewportScene:
        """The scene that draws the active view's picture."""
        return self.active.scene

    @property
    def hud(self) -> Hud:
        """The words over the active view's picture."""
        return self.active.hud

    def has_news(self, session: SessionView) -> bool:
        """Did a picture arrive that the window does not show yet? Cheap; asked at every tick."""
        if session.capture is None:
            return False
        has_news = False
        for index, pane in self._shown(session):
            with session.views.drawn(index):
                has_news |= pane.scene.has_news(session)  # each of them asks again for what it wants
        return has_news

    def shows_playhead(self, session: SessionView) -> bool:
        """Is the frame under the playhead on screen, in every picture?"""
        for index, pane in self._shown(session):
            with session.views.drawn(index):
                if not pane.shows_playhead(session):
                    return False
        return True

    def _shown(self, session: SessionView) -> list[tuple[int, PicturePane]]:
        """Views on screen and their pictures; one that cannot be drawn keeps nobody waiting."""
        panes = enumerate(self._panes[: session.views.n_shown])
        return [(index, pane) for index, pane in panes if not self._guard.is_failing(_name(index))]

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Toolbar, tools and pictures."""
        status = session.regions
        ui.regions.follow(session.rig, len(status.regions), can_mark=status.can_mark)
        start, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        area = Rect(start.x, start.y, start.x + room.x, start.y + room.y)
        if session.capture is None:
            imgui.get_window_draw_list().add_rect_filled(area.low, area.high, theme.u32(theme.VOID))
            draw_welcome(session, dispatch, ui, area, self.recent_rows)
            return
        bar = Rect(area.x0, area.y0, area.x1, area.y0 + TOOLBAR_HEIGHT)
        imgui.get_window_draw_list().add_rect_filled(bar.low, bar.high, theme.u32(theme.PANEL))
        draw_toolbar(session, dispatch, ui, self._view_popup)
        below = Rect(area.x0, bar.y1, area.x1, area.y1)
        if not ui.is_picture_only:
            draw_tool_strip(session, dispatch, ui, Rect(area.x0, bar.y1, area.x0 + STRIP_WIDTH, area.y1))
            below = Rect(area.x0 + STRIP_WIDTH, bar.y1, area.x1, area.y1)
        if below.width >= SMALLEST_PICTURE and below.height >= SMALLEST_PICTURE:
            self._draw_views(session, dispatch, ui, below)

    def _draw_views(self, session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
        views = session.views
        self._active = views.active_index
        draw = imgui.get_window_draw_list()
        if views.n_shown > 1:
            draw.add_rect_filled(area.low, area.high, theme.u32(theme.PANEL))  # shows as lines between the pictures
        for index, part in enumerate(view_areas(area, views.n_shown)):
            while len(self._panes) <= index:
                self._panes.append(self._make_pane())
            is_active = index == views.active_index
            ui.mark_rect(f"viewport.view{index}", part)
            self._draw_view(session, dispatch, ui, index, part)
            if is_active and views.n_shown > 1:
                draw.add_rect(part.low, part.high, theme.u32(theme.ON_PICTURE.sky), 0.0, 2.0)

    def _draw_view(self, session: SessionView, dispatch: Dispatch, ui: UiState, index: int, area: Rect) -> None:
        pane, is_active, name = self._panes[index], index == session.views.active_index, _name(index)

        def draw() -> None:
            with session.views.drawn(index):
                pane.draw(session, dispatch, ui, area, is_active=is_active)

        imgui.push_id(index)
        is_used = _is_used(area)
        if not self._guard.draw(name, draw):
            imgui.set_cursor_screen_pos(ImVec2(area.x0 + 12, area.y0 + 12))
            draw_failed(name)
        imgui.pop_id()
        if is_used and not is_active:
            dispatch(ActivateView(index))


def _name(index: int) -> str:
    """Name of a view where it fails."""
    return f"view {index + 1}"


def _is_used(area: Rect) -> bool:
    """Cover an area with an item that takes the pointer: was it pressed, or the wheel turned over it?"""
    imgui.set_cursor_screen_pos(area.low)
    buttons = imgui.ButtonFlags_
    flags = buttons.mouse_button_left | buttons.mouse_button_right | buttons.mouse_button_middle
    imgui.invisible_button("canvas", ImVec2(area.width, area.height), flags)
    wheel = (imgui.get_io().mouse_wheel, imgui.get_io().mouse_wheel_h)
    return imgui.is_item_activated() or (imgui.is_item_hovered() and any(wheel))
