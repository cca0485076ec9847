"""The viewport: toolbar, and one, two or four pictures of the same frame, each from its own view."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from imgui_bundle import imgui

from app.playback.views import Views
from app.session.commands import ActivateView
from ui.panels.hud import Hud
from ui.panels.navigation import ViewPopup
from ui.panels.panes import view_areas
from ui.panels.picture_pane import PictureNeeds, PicturePane
from ui.panels.recent_rows import RecentRows
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.toolbar import TOOLBAR_HEIGHT, ToolbarNeeds, draw_toolbar
from ui.panels.welcome import WelcomeNeeds, draw_welcome
from ui.style import theme
from ui.viewport.scene import Scene

SMALLEST_PICTURE = 32.0
"""With less room than this, there is nothing to draw."""


class ViewportNeeds(PictureNeeds, ToolbarNeeds, WelcomeNeeds, Protocol):
    """What the viewport shows."""

    @property
    def views(self) -> Views: ...


class ViewportPanel:
    """Owns the pictures. Those of views that are not shown keep what they hold until the window closes.

    Args:
        make_pane: Makes what one view is drawn with. GL thread only.
    """

    def __init__(self, make_pane: Callable[[], PicturePane], recent_rows: RecentRows) -> None:
        self.recent_rows = recent_rows
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
    def scene(self) -> Scene:
        """What the active view's picture is drawn with."""
        return self.active.scene

    @property
    def hud(self) -> Hud:
        """What stands over the active view's picture."""
        return self.active.hud

    def has_news(self, session: ViewportNeeds) -> bool:
        """Did a picture arrive that the window does not show yet? Cheap; asked at every tick."""
        if session.capture is None:
            return False
        has_news = False
        for index, pane in enumerate(self._panes[: session.views.n_shown]):
            with session.views.drawn(index):
                has_news |= pane.scene.has_news(session)  # each of them asks again for what it wants
        return has_news

    def shows_playhead(self, session: ViewportNeeds) -> bool:
        """Is the frame under the playhead on screen, in every picture?"""
        for index, pane in enumerate(self._panes[: session.views.n_shown]):
            with session.views.drawn(index):
                if not pane.shows_playhead(session):
                    return False
        return True

    def draw(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState) -> None:
        """Toolbar and pictures."""
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
        if below.width >= SMALLEST_PICTURE and below.height >= SMALLEST_PICTURE:
            self._draw_views(session, dispatch, ui, below)

    def _draw_views(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState, area: Rect) -> None:
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
            imgui.push_id(index)
            with views.drawn(index):
                is_used = self._panes[index].draw(session, dispatch, ui, part, is_active=is_active)
            imgui.pop_id()
            if is_used and not is_active:
                dispatch(ActivateView(index))
            if is_active and views.n_shown > 1:
                draw.add_rect(part.low, part.high, theme.u32(theme.ON_PICTURE.sky), 0.0, 2.0)
