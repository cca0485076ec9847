"""The box of a marker: its name, and a button that removes it."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.project_document import MAX_TEXT_CHARACTERS
from app.playback.timeline import Timeline
from app.session.editing.edit_commands import PutMarker, RemoveMarker
from ui.panels.state import Dispatch, Rect, UiState
from ui.style.theme import Icon

POPUP = "marker"
WIDTH = 240.0


def mark_playhead(timeline: Timeline, dispatch: Dispatch, ui: UiState) -> None:
    """Mark the frame under the playhead, and ask for the marker's name."""
    edit_marker(timeline, dispatch, ui, timeline.frame_index)


def edit_marker(timeline: Timeline, dispatch: Dispatch, ui: UiState, frame_index: int) -> None:
    """Ask for the name of a frame's marker, which is made where there is none."""
    view, marker = ui.timeline, timeline.markers.at(frame_index)
    gesture = view.begin_gesture()
    if marker is None:
        dispatch(PutMarker(frame_index, gesture=gesture))
        if timeline.markers.at(frame_index) is None:  # it was refused
            return
    view.marker_frame, view.marker_name = frame_index, "" if marker is None else marker.text
    view.is_marker_wanted = True


def draw_marker_box(timeline: Timeline, dispatch: Dispatch, ui: UiState, track: Rect) -> None:
    """While it is open; typed text counts at once, Enter and Escape only close it."""
    view = ui.timeline
    if view.is_marker_wanted:
        view.is_marker_wanted = False
        imgui.open_popup(POPUP)
    imgui.set_next_window_pos(ImVec2(track.x0 + 12, track.y0), imgui.Cond_.appearing, ImVec2(0, 1))
    if not imgui.begin_popup(POPUP):
        return
    imgui.text_unformatted(f"Marker at frame {view.marker_frame}")
    imgui.same_line()
    imgui.set_next_item_width(WIDTH)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    is_entered, view.marker_name = imgui.input_text_with_hint("##name", "name", view.marker_name, flags)
    ui.mark("timeline.marker name")
    if imgui.is_item_edited() or is_entered:
        dispatch(PutMarker(view.marker_frame, view.marker_name[:MAX_TEXT_CHARACTERS], view.gesture))
    imgui.same_line()
    if imgui.button(f"{Icon.TRASH}##remove"):
        if timeline.markers.at(view.marker_frame) is not None:
            dispatch(RemoveMarker(view.marker_frame))
        imgui.close_current_popup()
    ui.mark("timeline.marker remove")
    imgui.set_item_tooltip("Remove this marker")
    if is_entered or imgui.is_key_pressed(imgui.Key.escape, False):
        imgui.close_current_popup()
    imgui.end_popup()
