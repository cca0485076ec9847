"""One picture of the scene, from the place of one view: render, captured picture, marks, pointer and HUD.

What is drawn off screen, and when, is ui.viewport.scene's business.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.playback.modes.view_modes import MODES
from app.playback.views.pointing import point_beside
from app.session.session_view import SessionView
from ui.panels.editing.edit_grip import EditGrip
from ui.panels.editing.edit_subject import subject_of
from ui.panels.editing.handle_drawing import draw_edit_hint, draw_handles, draw_points
from ui.panels.editing.panel.marks import draw_chosen_sphere
from ui.panels.editing.selecting.select_drawing import draw_hint, draw_tool
from ui.panels.editing.selecting.select_grip import DRAG as SELECT
from ui.panels.editing.selecting.select_grip import SelectGrip
from ui.panels.excluding.excluded_drawing import ExcludedDrawing
from ui.panels.excluding.mask_grip import follow_brush
from ui.panels.picture.comparison import (
    covered_share,
    frame_to_compare,
    is_held,
    kind_words,
    missing_words,
    other_label,
    shown_compare,
)
from ui.panels.picture.gizmo import draw_gizmo, gizmo_rect
from ui.panels.picture.heat_overlay import HeatOverlay
from ui.panels.picture.hud import BELOW_NAME, Hud
from ui.panels.picture.key_grip import KeyGrip
from ui.panels.picture.panes import Panes, arrange
from ui.panels.picture.pointer import MOVING_S, Pointer
from ui.panels.pieces.key_words import key_words
from ui.panels.pieces.widgets import chip, elided
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.theme import ON_PICTURE
from ui.viewport.hud_text import RENDERED, captured_words, pane_text
from ui.viewport.layers.region_layer import ShownRegions
from ui.viewport.scene import SceneView, ViewportScene

TOOLTIP_AWAY = 22.0


class PicturePane:
    """Owns the GL objects of one view and the drag in progress there."""

    def __init__(self, scene: ViewportScene, heat: HeatOverlay) -> None:
        self.scene, self.heat = scene, heat
        self.pointer = Pointer()
        self.keys = KeyGrip()
        self.editing = EditGrip()
        self.selecting = SelectGrip()
        self.excluded = ExcludedDrawing()
        self.hud = Hud()
        self._aimed_at = (0.0, 0.0)
        self._captured_frame: int | None = None
        self._is_held = False

    def release(self) -> None:
        """Free GL objects. GL thread only."""
        self.scene.release()
        self.heat.release()

    def shows_playhead(self, session: SessionView) -> bool:
        """Is the frame under the playhead on screen, in every picture that is compared?"""
        wanted = session.wanted_frame()
        is_other_there = self._captured_frame in (None, frame_to_compare(session))
        return wanted is None or (self.scene.shown.is_of(wanted) and is_other_there)

    def draw(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect, *, is_active: bool = True
    ) -> None:
        """Draw into an area of the window, which the newest item covers, and take up what the pointer did there.

        Args:
            session: Its current view is the one to draw.
            is_active: Whether keys act on this view; what is being chosen is chosen here.
        """
        if is_active:
            ui.mark_rect("viewport.canvas", area)
        shown = session.view.look_through
        image_size = None
        if shown is not None:
            width, height = session.rig.image_sizes[shown]
            image_size = (int(width), int(height))
        self._is_held = is_active and is_held(session, ui)
        panes = arrange(area, image_size, "wipe" if self._is_held else shown_compare(session))
        self.pointer.navigate(
            session,
            dispatch,
            ui,
            panes,
            area,
            lambda x, y: self._pick(session, panes.rendered, x, y),
            is_active=is_active,
        )
        # Looking through a camera may just have ended; the picture then fills the area from the next frame on.
        self._draw_picture(session, dispatch, ui, area, panes, is_active=is_active)
        gizmo = gizmo_rect(area) if panes.captured is None else None
        if gizmo is not None:
            pointer = imgui.get_io().mouse_pos
            draw_gizmo(imgui.get_window_draw_list(), session.view, gizmo, (pointer.x, pointer.y))
            if is_active:
                ui.mark_rect("viewport.gizmo", gizmo)
        value = self._value_under_pointer(panes.rendered)
        free = self.heat.beside(area)
        legend_x = free.x1 - 12 if gizmo is None else min(free.x1 - 12, gizmo.x0 - 8)
        # In a wipe the captured picture lies where the rendered one does, and the words that name them above both.
        legend_y = panes.rendered.y0 + BELOW_NAME if panes.captured == panes.rendered else area.y0 + 12
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect(area.low, area.high, True)
        self.hud.draw(session, ui, free, self.scene, value=value, legend_at=(legend_x, legend_y))
        draw.pop_clip_rect()
        if is_active:
            top = panes.captured.y0 + BELOW_NAME if panes.captured is not None else area.y0 + 12
            self._draw_hints(ui, Rect(area.x0 + 12, top, self.hud.legend_x0 - 8, area.y1))

    def _draw_hints(self, ui: UiState, free: Rect) -> None:
        """The function of the tool in use."""
        draw = imgui.get_window_draw_list()
        if ui.editing.asking is not None or ui.editing.held is not None:
            draw_edit_hint(draw, ui.editing, free)
        elif ui.regions.is_active:
            draw_chosen_sphere(ui, draw, free, self.scene.regions.counts)
        elif ui.selecting.is_active:
            draw_hint(draw, ui.selecting, free)

    # ---- picture ---------------------------------------------------------------------------------------------

    def _draw_picture(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, area: Rect, panes: Panes, *, is_active: bool
    ) -> None:
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect(area.low, area.high, True)
        pane = panes.rendered
        if pane != area:  # the backdrop shows; where the picture covers everything it would only cost time
            draw.add_rect_filled(area.low, area.high, theme.u32(theme.VOID))
        if is_active:
            ui.mark_rect("viewport.rendered", pane)
        density = imgui.get_io().display_framebuffer_scale.x
        view = self._scene_view(session, pane)
        self.scene.marks.pixels_per_unit = self.scene.path.pixels_per_unit = density
        self.scene.selection.pixels_per_unit = self.scene.objects.pixels_per_unit = density
        ui.objects.follow(session.edits.objects)
        self.scene.objects.outlined = ui.objects.outlined(session.edits.objects)
        self.keys.follow(session, dispatch, ui, self.scene.path, self.pointer, view, pane, density)
        self._point_at_camera(session, ui, view, pane, density)
        if is_active:
            pick = lambda x, y: self._pick(session, pane, x, y)  # noqa: E731
            self.editing.follow(session, dispatch, ui, self.pointer, view, pane, density, pick)
        self._select(session, dispatch, ui, view, pane, density)
        if is_active:
            follow_brush(session, dispatch, ui, self.pointer, pane)
            self._aim(session, ui, view, pane, density)
            command = ui.regions.take_accepted()
            if command is not None:
                dispatch(command)
        tool, shown = ui.regions, ShownRegions(sphere=ui.regions.sphere)
        if session.overlays.show_regions:
            shown = ShownRegions(session.regions.regions, tool.highlighted, tool.sphere)
        composed = self.scene.compose(session, view, shown)
        draw.add_image(imgui.ImTextureRef(composed.texture.glo), pane.low, pane.high)
        self.heat.draw(session, ui, pane)
        self.excluded.draw(draw, session, ui, pane)
        if is_active or self.pointer.drag == SELECT:
            draw_tool(draw, ui.selecting, view, pane, density, np.asarray(session.view.up, np.float64))
        subject = subject_of(session, ui)
        if subject is not None and not ui.regions.is_active:
            draw_handles(draw, subject, ui, view, pane, density)
        draw_points(draw, ui.editing, view, pane, density)
        if self.pointer.is_moving:
            ui.redraw_within(MOVING_S)
        elif (
            imgui.is_item_hovered()
            and self.pointer.drag is None
            and not (tool.is_active or ui.selecting.is_active or ui.masks.is_active)
        ):
            camera, key = self.scene.marks.pointed_camera, self.scene.path.pointed_key
            if key is not None:
                words = f"{key_words(session.paths, key)}\nDrag to move it, with Ctrl along the view"
                _tooltip_beside(f"{words}; double-click to go there", area)
            elif camera is not None:
                is_held_out = " (held out)" if camera in session.holdout else ""
                _tooltip_beside(f"Camera {session.rig.names[camera]}{is_held_out}\nClick to look through it", area)
            else:
                text = self.scene.anchor_text(session, view, *_pixels(pane, density))
                if text:
                    _tooltip_beside(text, area)
        else:
            self.scene.marks.pointed_anchor = None
        if is_active:
            ui.pointed_anchor = self.scene.marks.pointed_anchor
        self._captured_frame = None
        if panes.captured is None:
            self.scene.forget_other()
        else:
            self._draw_captured(session, draw, ui, view, panes)
        self.heat.draw_words()
        draw.pop_clip_rect()

    def _scene_view(self, session: SessionView, pane: Rect) -> SceneView:
        density = imgui.get_io().display_framebuffer_scale.x
        size = (max(round(pane.width * density), 16), max(round(pane.height * density), 16))
        view = session.view
        return SceneView(
            world_to_camera=view.world_to_camera(),
            K=view.K(*size),
            width=size[0],
            height=size[1],
            is_moving=self.pointer.is_moving,
            near=view.near,
            set_back=view.set_back,
        )

    def _pick(self, session: SessionView, pane: Rect, x: float, y: float) -> np.ndarray | None:
        """The place of the scene that is seen at a point of the window; None where there is nothing."""
        density = imgui.get_io().display_framebuffer_scale.x
        view = self._scene_view(session, pane)
        return self.scene.point_under(session, view, (x - pane.x0) * density, (y - pane.y0) * density)

    def _value_under_pointer(self, pane: Rect) -> float | None:
        pointer = imgui.get_io().mouse_pos
        if not imgui.is_item_hovered() or not pane.contains(pointer.x, pointer.y):
            return None
        return self.scene.value_at((pointer.x - pane.x0) / pane.width, (pointer.y - pane.y0) / pane.height)

    def _point_at_camera(self, session: SessionView, ui: UiState, view: SceneView, pane: Rect, density: float) -> None:
        """The camera under the pointer stands out; one that was pressed is remembered for the click."""
        is_choosing = ui.regions.is_active or ui.selecting.is_active or ui.masks.is_active
        is_free = imgui.is_item_hovered() and not is_choosing and self.scene.path.pointed_key is None
        is_pressing = imgui.is_item_activated() and self.pointer.button == imgui.MouseButton_.left
        marks = self.scene.marks
        if is_free and (is_pressing or (self.pointer.drag is None and not self.pointer.is_moving)):
            marks.pointed_camera = marks.camera_under(session, view, *_pixels(pane, density))
        elif self.pointer.pressed_camera is None:
            marks.pointed_camera = None
        if imgui.is_item_activated():
            self.pointer.pressed_camera = marks.pointed_camera if is_pressing and self.pointer.drag == "view" else None
        if marks.pointed_camera is not None:
            marks.pointed_anchor = None
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)

    def _select(
        self, session: SessionView, dispatch: Dispatch, ui: UiState, view: SceneView, pane: Rect, density: float
    ) -> None:
        anchors = session.shown_anchors() if ui.selecting.is_active else None
        spacing = 0.0 if anchors is None else anchors.spacing
        self.selecting.follow(
            session,
            dispatch,
            ui,
            self.pointer,
            view,
            pane,
            density,
            lambda x, y: self._pick(session, pane, x, y),
            spacing,
        )

    def _aim(self, session: SessionView, ui: UiState, view: SceneView, pane: Rect, density: float) -> None:
        """Lead the sphere that is being chosen: to the middle at first, then by the pointer, until a click fixes it."""
        tool, pointer = ui.regions, imgui.get_io().mouse_pos
        is_click = self.pointer.take_click()
        if not tool.is_active:
            return
        at = (pointer.x, pointer.y)
        is_over = imgui.is_item_hovered() and pane.contains(*at)
        is_led = is_over and not tool.is_placed and self.pointer.drag is None
        is_led &= at != self._aimed_at or session.view.is_moving
        if tool.center is not None and not is_led and not (is_over and is_click):
            return
        self._aimed_at = at
        x, y = at if is_over else pane.center
        away = session.view.pivot if tool.center is None else tool.center
        pixels = ((x - pane.x0) * density, (y - pane.y0) * density)
        place = self.scene.point_under(session, view, *pixels)
        if place is None:
            place = point_beside(view.world_to_camera, view.K, *pixels, away)
        tool.place(place, eye=session.view.shown_pose.standpoint)
        tool.is_placed |= is_click

    def _draw_captured(
        self, session: SessionView, draw: imgui.ImDrawList, ui: UiState, view: SceneView, panes: Panes
    ) -> None:
        area = panes.captured
        assert area is not None
        other = self.scene.other(session, view)
        shown = self.scene.shown
        self._captured_frame = None if other is None else other.frame_index
        frames = (None if other is None else other.frame_index, shown.source.frame_index)
        if other is None:
            clip = session.timeline.clip
            versions = () if clip is None else session.clip_versions(clip.clip_index)
            words = missing_words(session.overlays, versions, session.other_project)
        elif other.shown_as is None:
            words = pane_text(captured_words(other.has_scene_colors), *frames)
        else:
            overlays = session.overlays
            is_own = overlays.compare_with in MODES
            kind = (
                kind_words(RENDERED, other.shown_as.label) if is_own else other_label(overlays, session.other_project)
            )
            last = frame_to_compare(session)
            is_past_end = frames == (last, session.timeline.frame_index) and frames[0] != frames[1]
            words = f"{kind} has no such frame, {last} is its last" if is_past_end else pane_text(kind, *frames)
        rendered_words = pane_text(kind_words(shown.kind, shown.source.shown_as.label), *frames[::-1])
        color = ON_PICTURE.yellow if None not in frames and frames[0] != frames[1] else ON_PICTURE.text
        compare = session.overlays.compare
        if compare == "side" and not self._is_held:
            if other is not None:
                draw.add_image(imgui.ImTextureRef(other.texture.glo), area.low, area.high)
            for one, name in ((area, words), (panes.rendered, rendered_words)):
                chip(draw, one.x0 + 10, one.y0 + 10, _fitting_name(name, one.width), color=color)
            return
        share = covered_share(session, ui, is_held=self._is_held)
        x = area.x0 + area.width * share
        if other is not None:
            draw.add_image(
                imgui.ImTextureRef(other.texture.glo), area.low, ImVec2(x, area.y1), ImVec2(0, 0), ImVec2(share, 1)
            )
        if compare == "wipe" and not self._is_held:
            _draw_handle(draw, area, x)
        room = area.width / 2 if 0.15 < share < 0.85 else area.width
        if share > 0.15:
            chip(draw, area.x0 + 10, area.y0 + 10, _fitting_name(words, room), color=color)
        if share < 0.85:
            chip(draw, area.x1 - 10, area.y0 + 10, _fitting_name(rendered_words, room), color=color, is_right=True)


def _fitting_name(words: str, room: float) -> str:
    """Name of a picture, in so much of its width: without the frame, which the label below names too, and cut
    only where even that is too long."""
    width = room - 34
    return words if imgui.calc_text_size(words).x <= width else elided(words.partition(",")[0], width)


def _draw_handle(draw: imgui.ImDrawList, area: Rect, x: float) -> None:
    """The line between the two pictures, and the knob that moves it."""
    white, dark, middle = theme.u32(ON_PICTURE.playhead), theme.u32(theme.VOID), area.center[1]
    draw.add_line_v(x, area.y0, area.y1, white, 2)
    draw.add_circle_filled(ImVec2(x, middle), 9, white)
    draw.add_triangle_filled(ImVec2(x - 6, middle), ImVec2(x - 2, middle - 4), ImVec2(x - 2, middle + 4), dark)
    draw.add_triangle_filled(ImVec2(x + 6, middle), ImVec2(x + 2, middle + 4), ImVec2(x + 2, middle - 4), dark)


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
