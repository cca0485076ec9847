"""The viewport: the scene at the user's time and view, compared with the captured picture, with overlays and a HUD.

Turns pointer input over the picture into view changes. What is drawn off screen, and when, is ui.viewport.scene's
business.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.commands import LookThrough, ToggleOverlay
from app.status import COMPARE_MODES
from ui.panels.hud import Hud, HudNeeds
from ui.panels.regions import begin_choosing, draw_chosen_sphere
from ui.panels.shortcuts import ShortcutNeeds, cloud_overlay, set_compare, shown_compare
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.welcome import WelcomeNeeds, draw_welcome
from ui.panels.widgets import chip
from ui.style import theme
from ui.style.theme import Icon
from ui.viewport.hud_text import captured_words, pane_text
from ui.viewport.region_layer import ShownRegions
from ui.viewport.region_tool import GROWTH
from ui.viewport.scene import Scene, SceneNeeds, SceneView

MOVING_S = 0.22
"""The view counts as moving for this long after the last change of it."""
WIPE_GRAB_PX = 9.0
CLICK_PX = 4.0
"""A press that moves less than this before its release is a click, where clicks mean something."""
TOOLBAR_HEIGHT = 38.0
TOOLTIP_AWAY = 22.0
TOOLBAR_WIDTH = 610.0
"""With less room, words give way to symbols."""
MARK_SLIDER = imgui.SliderFlags_.always_clamp
COMPARE_WORDS = {"off": "Off", "wipe": "Wipe", "side": "Side by side"}


class ViewportNeeds(SceneNeeds, HudNeeds, ShortcutNeeds, WelcomeNeeds, Protocol):
    """What the picture, and everything that lies over it, is made from."""


@dataclass(frozen=True)
class Panes:
    """Where the rendered and the captured picture lie."""

    rendered: Rect
    captured: Rect | None


def fit(area: Rect, width: float, height: float) -> Rect:
    """The largest rectangle of this aspect, centred in the area."""
    scale = min(area.width / max(width, 1.0), area.height / max(height, 1.0))
    x, y = area.center
    return Rect(x - width * scale / 2, y - height * scale / 2, x + width * scale / 2, y + height * scale / 2)


def arrange(area: Rect, image_size: tuple[int, int] | None, compare: str) -> Panes:
    """Lay out the panes; without a capture camera the whole area is the rendered picture."""
    if image_size is None:
        return Panes(area, None)
    if compare == "side":
        middle = area.center[0]
        left = fit(Rect(area.x0, area.y0, middle - 2, area.y1), *image_size)
        right = fit(Rect(middle + 2, area.y0, area.x1, area.y1), *image_size)
        return Panes(rendered=right, captured=left)
    pane = fit(area, *image_size)
    return Panes(pane, pane if compare == "wipe" else None)


class ViewportPanel:
    """Owns the scene's GL objects and the drag in progress."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._drag: str | None = None
        self._button: int = 0
        self._pressed_at = (0.0, 0.0)
        self._is_click = False
        self._pressed_camera: int | None = None
        self._aimed_at = (0.0, 0.0)
        self._moved_s = -1e9
        self.hud = Hud()
        self._captured_frame: int | None = None

    def release(self) -> None:
        """Free GL objects. GL thread only."""
        self.scene.release()

    @property
    def is_moving(self) -> bool:
        """Did the view change a moment ago?"""
        return time.perf_counter() - self._moved_s < MOVING_S

    def note_moved(self) -> None:
        """The view was changed by something else than the pointer here."""
        self._moved_s = time.perf_counter()

    def has_news(self, session: ViewportNeeds) -> bool:
        """Did a picture arrive that the window does not show yet? Cheap; asked at every tick."""
        return session.capture is not None and self.scene.has_news(session)

    def shows_playhead(self, session: ViewportNeeds) -> bool:
        """Is the frame under the playhead on screen, in every picture that is compared?"""
        wanted = session.wanted_frame()
        return wanted is None or (self.scene.shown.is_of(wanted) and self._captured_frame in (None, wanted.frame_index))

    def draw(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState) -> None:
        """Toolbar, picture, HUD."""
        status = session.regions
        ui.regions.follow(session.rig, len(status.regions), can_mark=status.can_mark)
        if session.capture is None:
            origin, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
            area = Rect(origin.x, origin.y, origin.x + size.x, origin.y + size.y)
            imgui.get_window_draw_list().add_rect_filled(area.low, area.high, theme.u32(theme.VOID))
            draw_welcome(session, dispatch, ui, area)
            return
        start = imgui.get_cursor_screen_pos()
        width, height = imgui.get_content_region_avail().x, imgui.get_content_region_avail().y
        bar = Rect(start.x, start.y, start.x + width, start.y + TOOLBAR_HEIGHT)
        imgui.get_window_draw_list().add_rect_filled(bar.low, bar.high, theme.u32(theme.PANEL))
        self._draw_toolbar(session, dispatch, ui)
        area = Rect(bar.x0, bar.y1, bar.x1, bar.y1 + height - TOOLBAR_HEIGHT)
        if area.width < 32 or area.height < 32:
            return
        imgui.set_cursor_screen_pos(area.low)
        buttons = imgui.ButtonFlags_
        flags = buttons.mouse_button_left | buttons.mouse_button_right | buttons.mouse_button_middle
        imgui.invisible_button("canvas", ImVec2(area.width, area.height), flags)
        ui.mark_rect("viewport.canvas", area)
        shown = session.view.look_through
        image_size = None
        if shown is not None:
            width, height = session.rig.image_sizes[shown]
            image_size = (int(width), int(height))
        panes = arrange(area, image_size, session.overlays.compare)
        self._navigate(session, dispatch, ui, panes)
        # Looking through a camera may just have ended; the picture then fills the area from the next frame on.
        self._draw_picture(session, dispatch, ui, area, panes)
        self.hud.draw(session, ui, area, self.scene)
        if ui.regions.is_active:
            top = panes.captured.y0 + 44 if panes.captured is not None else area.y0 + 12  # below what names the pane
            free = Rect(area.x0 + 12, top, area.x1, area.y1)
            draw_chosen_sphere(ui, imgui.get_window_draw_list(), free, self.scene.regions.counts)

    # ---- toolbar ---------------------------------------------------------------------------------------------

    def _draw_toolbar(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState) -> None:
        imgui.set_cursor_pos(ImVec2(imgui.get_cursor_pos_x() + 8, imgui.get_cursor_pos_y() + 6))
        shown = session.view.look_through
        names = session.rig.names
        room = imgui.get_content_region_avail().x
        is_roomy = room > TOOLBAR_WIDTH
        imgui.align_text_to_frame_padding()
        if is_roomy:
            imgui.text_disabled("View")
            imgui.same_line()
        imgui.set_next_item_width(150 if is_roomy else min(120, max(room - 230, 40)))
        if imgui.begin_combo("##camera", "Free" if shown is None else names[shown]):
            if imgui.selectable("Free", shown is None)[0]:
                dispatch(LookThrough(None))
            for index, name in enumerate(names):
                imgui.push_id(index)  # names may be equal before a "##", which is all that ImGui would tell apart
                is_chosen = imgui.selectable("##camera", shown == index)[0]
                ui.mark(f"viewport.camera{index}")
                imgui.same_line(0, 0)
                imgui.text(name)
                imgui.pop_id()
                if is_chosen:
                    dispatch(LookThrough(index))
            imgui.end_combo()
        ui.mark("viewport.camera")
        imgui.set_item_tooltip("Look through a capture camera ([ and ])")
        imgui.same_line(0, 18 if is_roomy else 8)
        if is_roomy:
            imgui.text_disabled("Compare")
            for mode in COMPARE_MODES:
                imgui.same_line(0, 8 if mode == "off" else 2)
                if _segment(COMPARE_WORDS[mode], shown_compare(session) == mode):
                    set_compare(session, dispatch, mode)
                ui.mark(f"viewport.compare.{mode}")
                imgui.set_item_tooltip("Beside or over the picture that the camera took (G)")
        else:
            self._draw_compare_box(session, dispatch, ui)
        imgui.same_line(0, 18 if is_roomy else 8)
        if imgui.button(f"{Icon.EYE}  Show" if is_roomy else f"{Icon.EYE}##show"):
            imgui.open_popup("overlays")
        ui.mark("viewport.overlays")
        self._draw_overlay_menu(session, dispatch, ui)
        imgui.same_line(0, 8)
        imgui.begin_disabled(not session.regions.can_mark)
        if _segment(f"{Icon.REGION}  Mark" if is_roomy else Icon.REGION, ui.regions.is_active):
            if ui.regions.is_active:
                ui.regions.leave()
            else:
                begin_choosing(session, ui)
        ui.mark("viewport.mark")
        imgui.end_disabled()
        words = session.regions.why_not or "Say of a part of the scene that it is static, or that it moves (M)"
        if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            imgui.set_tooltip(words)

    def _draw_compare_box(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState) -> None:
        """All ways to compare in one place, where there is no room for buttons."""
        shown = shown_compare(session)
        imgui.set_next_item_width(118)
        if imgui.begin_combo("##compare", "Compare" if shown == "off" else COMPARE_WORDS[shown]):
            for mode in COMPARE_MODES:
                if imgui.selectable(COMPARE_WORDS[mode], shown == mode)[0]:
                    set_compare(session, dispatch, mode)
                ui.mark(f"viewport.compare.{mode}")
            imgui.end_combo()
        ui.mark("viewport.compare")
        imgui.set_item_tooltip("Beside or over the picture that the camera took (G)")

    def _draw_overlay_menu(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState) -> None:
        if not imgui.begin_popup("overlays"):
            return
        rows = (
            ("show_frusta", "Cameras", "1"),
            ("show_inherited", "Inherited anchors (circles)", "2"),
            ("show_residual", "Residual anchors (diamonds)", "3"),
            (cloud_overlay(session), "Point cloud", "4"),
            ("show_regions", "Marked regions", "5"),
        )
        for name, label, key_label in rows:
            if imgui.menu_item(label, key_label, bool(getattr(session.overlays, name)), True)[0]:
                dispatch(ToggleOverlay(name))
            ui.mark(f"show.{name}")
        imgui.separator()
        overlays = session.overlays
        imgui.text_disabled("Anchor marks")
        imgui.set_next_item_width(150)
        size = imgui.slider_float("Size", overlays.mark_size * 100.0, 50.0, 300.0, "%.0f %%", MARK_SLIDER)
        overlays.mark_size = size[1] / 100.0
        ui.mark("show.mark_size")
        imgui.set_next_item_width(150)
        opacity = imgui.slider_float("Opacity", overlays.mark_opacity * 100.0, 10.0, 100.0, "%.0f %%", MARK_SLIDER)
        overlays.mark_opacity = opacity[1] / 100.0
        ui.mark("show.mark_opacity")
        imgui.separator()
        imgui.text_disabled("Tab hides or shows cameras and anchors")
        imgui.end_popup()

    # ---- pointer ---------------------------------------------------------------------------------------------

    def _navigate(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState, panes: Panes) -> None:
        io = imgui.get_io()
        view, tool = session.view, ui.regions
        if imgui.is_item_hovered() and io.mouse_wheel != 0.0:
            if tool.sphere is not None and not io.key_ctrl:
                tool.set_radius(tool.radius * GROWTH**io.mouse_wheel)
            else:
                self._leave_camera(session, dispatch)
                view.dolly(0.9**io.mouse_wheel)
                self.note_moved()
        if imgui.is_item_activated():
            self._pressed_at = (io.mouse_pos.x, io.mouse_pos.y)
            buttons = (imgui.MouseButton_.left, imgui.MouseButton_.right, imgui.MouseButton_.middle)
            self._button = next((button for button in buttons if imgui.is_mouse_down(button)), buttons[0])
            self._drag = "wipe" if self._is_on_wipe(session, panes, io.mouse_pos) else "view"
            return  # the pointer's way to where it was pressed is not a drag
        # The last stretch of a quick drag arrives in the same frame as the release, when the item is active no more.
        is_dragged = imgui.is_item_active() or (imgui.is_item_deactivated() and self._drag is not None)
        if not is_dragged:
            self._drag = None
            if imgui.is_item_hovered() and self._is_on_wipe(session, panes, io.mouse_pos):
                imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            return
        if self._drag == "wipe":
            share = (io.mouse_pos.x - panes.rendered.x0) / max(panes.rendered.width, 1.0)
            session.overlays.wipe_position = min(max(share, 0.0), 1.0)
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
            return
        if self._pressed_camera is not None:
            x, y = self._pressed_at
            if max(abs(io.mouse_pos.x - x), abs(io.mouse_pos.y - y)) < CLICK_PX:
                if imgui.is_item_deactivated():
                    dispatch(LookThrough(self._pressed_camera))
                return
            self._pressed_camera = None  # it became a drag
        if tool.is_active and self._button == imgui.MouseButton_.left and self._drag == "view":
            x, y = self._pressed_at
            if max(abs(io.mouse_pos.x - x), abs(io.mouse_pos.y - y)) < CLICK_PX:
                self._is_click = imgui.is_item_deactivated()
                return
            self._drag = "turn"  # from here on it is not a click, even if it comes back
        dx, dy = io.mouse_delta.x, io.mouse_delta.y
        if dx == 0.0 and dy == 0.0:
            return
        self._leave_camera(session, dispatch)
        is_middle = self._button == imgui.MouseButton_.middle
        if self._button == imgui.MouseButton_.right or (is_middle and io.key_shift):
            view.pan(dx, dy)
        elif is_middle and io.key_ctrl:
            view.dolly(1.01**dy)
        else:
            view.orbit(dx, dy)
        self.note_moved()

    def _leave_camera(self, session: ViewportNeeds, dispatch: Dispatch) -> None:
        if session.view.look_through is not None:
            dispatch(LookThrough(None))

    def _is_on_wipe(self, session: ViewportNeeds, panes: Panes, pointer: ImVec2) -> bool:
        if session.overlays.compare != "wipe" or panes.captured is None:
            return False
        x = panes.rendered.x0 + panes.rendered.width * session.overlays.wipe_position
        return abs(pointer.x - x) <= WIPE_GRAB_PX and panes.rendered.y0 <= pointer.y <= panes.rendered.y1

    # ---- picture ---------------------------------------------------------------------------------------------

    def _draw_picture(self, session: ViewportNeeds, dispatch: Dispatch, ui: UiState, area: Rect, panes: Panes) -> None:
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect(area.low, area.high, True)
        pane = panes.rendered
        if pane != area:  # the backdrop shows; where the picture covers everything it would only cost time
            draw.add_rect_filled(area.low, area.high, theme.u32(theme.VOID))
        ui.mark_rect("viewport.rendered", pane)
        density = imgui.get_io().display_framebuffer_scale.x
        size = (max(round(pane.width * density), 16), max(round(pane.height * density), 16))
        view = SceneView(
            world_to_camera=session.view.world_to_camera(),
            K=session.view.K(*size),
            width=size[0],
            height=size[1],
            is_moving=self.is_moving,
        )
        self.scene.marks.pixels_per_unit = density
        self._point_at_camera(session, ui, view, pane, density)
        self._aim(session, ui, view, pane, density)
        command = ui.regions.take_accepted()
        if command is not None:
            dispatch(command)
        tool, shown = ui.regions, ShownRegions(sphere=ui.regions.sphere)
        if session.overlays.show_regions:
            shown = ShownRegions(session.regions.regions, tool.highlighted, tool.sphere)
        composed = self.scene.compose(session, view, shown)
        draw.add_image(imgui.ImTextureRef(composed.texture.glo), pane.low, pane.high)
        if self.is_moving:
            ui.redraw_within(MOVING_S)
        elif imgui.is_item_hovered() and self._drag is None and not tool.is_active:
            camera = self.scene.marks.pointed_camera
            if camera is not None:
                is_held_out = " (held out)" if camera in session.holdout else ""
                _tooltip_beside(f"Camera {session.rig.names[camera]}{is_held_out}\nClick to look through it", area)
            else:
                text = self.scene.anchor_text(session, view, *_pixels(pane, density))
                if text:
                    _tooltip_beside(text, area)
        else:
            self.scene.marks.pointed_anchor = None
        self._captured_frame = None
        if panes.captured is not None:
            self._draw_captured(session, draw, panes)
        draw.pop_clip_rect()

    def _point_at_camera(
        self, session: ViewportNeeds, ui: UiState, view: SceneView, pane: Rect, density: float
    ) -> None:
        """The camera under the pointer stands out; one that was pressed is remembered for the click."""
        is_free = imgui.is_item_hovered() and not ui.regions.is_active
        is_pressing = imgui.is_item_activated() and self._button == imgui.MouseButton_.left
        marks = self.scene.marks
        if is_free and (is_pressing or (self._drag is None and not self.is_moving)):
            marks.pointed_camera = marks.camera_under(session, view, *_pixels(pane, density))
        elif self._pressed_camera is None:
            marks.pointed_camera = None
        if imgui.is_item_activated():
            self._pressed_camera = marks.pointed_camera if is_pressing and self._drag == "view" else None
        if marks.pointed_camera is not None:
            marks.pointed_anchor = None
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)

    def _aim(self, session: ViewportNeeds, ui: UiState, view: SceneView, pane: Rect, density: float) -> None:
        """Lead the sphere that is being chosen: to the middle at first, then by the pointer, until a click fixes it."""
        tool, pointer = ui.regions, imgui.get_io().mouse_pos
        is_click, self._is_click = self._is_click, False
        if not tool.is_active:
            return
        at = (pointer.x, pointer.y)
        is_over = imgui.is_item_hovered() and pane.contains(*at)
        is_led = is_over and not tool.is_placed and self._drag is None and at != self._aimed_at
        if tool.center is not None and not is_led and not (is_over and is_click):
            return
        self._aimed_at = at
        x, y = at if is_over else pane.center
        away = session.view.pivot if tool.center is None else tool.center
        depth = max(float(np.linalg.norm(away - view.eye)), 1e-6)
        pixels = ((x - pane.x0) * density, (y - pane.y0) * density)
        tool.place(self.scene.point_under(session, view, *pixels, depth), eye=view.eye)
        tool.is_placed |= is_click

    def _draw_captured(self, session: ViewportNeeds, draw: imgui.ImDrawList, panes: Panes) -> None:
        area = panes.captured
        assert area is not None
        captured = self.scene.captured(session, round(area.width))
        shown = self.scene.shown
        self._captured_frame = None if captured is None else captured.frame_index
        frames = (None if captured is None else captured.frame_index, shown.source.frame_index)
        words = (
            "Captured picture is being read"
            if captured is None
            else pane_text(captured_words(captured.has_scene_colors), *frames)
        )
        rendered_words = pane_text(shown.kind, *frames[::-1])
        color = theme.YELLOW if None not in frames and frames[0] != frames[1] else theme.TEXT
        if session.overlays.compare == "side":
            if captured is not None:
                draw.add_image(imgui.ImTextureRef(captured.texture.glo), area.low, area.high)
            chip(draw, area.x0 + 10, area.y0 + 10, words, color=color)
            chip(draw, panes.rendered.x0 + 10, panes.rendered.y0 + 10, rendered_words, color=color)
            return
        share = session.overlays.wipe_position
        x = area.x0 + area.width * share
        if captured is not None:
            draw.add_image(
                imgui.ImTextureRef(captured.texture.glo), area.low, ImVec2(x, area.y1), ImVec2(0, 0), ImVec2(share, 1)
            )
        white = theme.u32(theme.PLAYHEAD)
        draw.add_line_v(x, area.y0, area.y1, white, 2)
        middle = area.center[1]
        draw.add_circle_filled(ImVec2(x, middle), 9, white)
        dark = theme.u32(theme.VOID)
        draw.add_triangle_filled(ImVec2(x - 6, middle), ImVec2(x - 2, middle - 4), ImVec2(x - 2, middle + 4), dark)
        draw.add_triangle_filled(ImVec2(x + 6, middle), ImVec2(x + 2, middle + 4), ImVec2(x + 2, middle - 4), dark)
        if share > 0.15:
            chip(draw, area.x0 + 10, area.y0 + 10, words, color=color)
        if share < 0.85:
            chip(draw, area.x1 - 10, area.y0 + 10, rendered_words, color=color, is_right=True)


def _pixels(pane: Rect, density: float) -> tuple[float, float]:
    """Where the pointer is, in pixels of the picture in a pane."""
    pointer = imgui.get_io().mouse_pos
    return (pointer.x - pane.x0) * density, (pointer.y - pane.y0) * density


def _tooltip_beside(text: str, area: Rect) -> None:
    """A tooltip that does not cover what is pointed at: away from the pointer, on the side where there is room."""
    pointer = imgui.get_io().mouse_pos
    is_left, is_above = pointer.x > area.center[0], pointer.y > area.center[1]
    x = pointer.x + (-TOOLTIP_AWAY if is_left else TOOLTIP_AWAY)
    y = pointer.y + (-TOOLTIP_AWAY if is_above else TOOLTIP_AWAY)
    imgui.set_next_window_pos(
        ImVec2(x, y), imgui.Cond_.always, ImVec2(1.0 if is_left else 0.0, 1.0 if is_above else 0.0)
    )
    imgui.set_tooltip(text)


def _segment(label: str, is_on: bool) -> bool:
    if is_on:
        imgui.push_style_color(imgui.Col_.button, ImVec4(*theme.faded(theme.SKY, 0.9)))
        imgui.push_style_color(imgui.Col_.button_hovered, ImVec4(*theme.SKY))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_ON_ACCENT))
    is_clicked = imgui.button(f"{label}##compare")
    if is_on:
        imgui.pop_style_color(3)
    return is_clicked
