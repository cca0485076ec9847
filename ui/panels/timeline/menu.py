"""The menu of a clip: by the right button on its band, or by key for the clip under the playhead."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.mending.mend_commands import AskMend
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from engine.capture.clip import Clip
from ui.panels.clips.menu import draw_cutting
from ui.panels.editing.labels import draw_label_field
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.clip_words import clip_title, state_words
from ui.panels.timeline.rows.seam_lane import seam_at
from ui.panels.timeline.rows.stage import TimelineStage
from ui.panels.training.clip_training_menu import draw_clip_training
from ui.style.theme import Icon

POPUP = "clip menu"


def draw_clip_menu(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> None:
    """Opens after a click with the right button on the item drawn last, the track; draws the menu while it is open."""
    ui = stage.ui
    imgui.open_popup_on_item_click(POPUP, imgui.PopupFlags_.mouse_button_right)
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_blocked_by_popup) and imgui.is_mouse_released(1):
        seam = seam_at(stage, session)  # its mark reaches into the clip before
        at_pointer = stage.scale.frame_at(imgui.get_io().mouse_pos.x)
        ui.timeline.menu_frame = at_pointer if seam is None else session.clips[seam[0]].start
    is_by_key = ui.timeline.is_menu_wanted
    if is_by_key:
        ui.timeline.is_menu_wanted = False
        ui.timeline.menu_frame = session.timeline.frame_index
        imgui.open_popup(POPUP)
        imgui.set_nav_cursor_visible(True)  # the keyboard continues in it at once
    if not imgui.begin_popup(POPUP):
        return
    clip = session.timeline.clip_of(ui.timeline.menu_frame)
    if clip is not None:
        state = session.clip_states[clip.clip_index].state
        imgui.text_disabled(f"{clip_title(clip.clip_index, session.reference_index)}: {state_words(state, session)}")
        draw_clip_training(session, dispatch, ui, clip.clip_index, is_by_key=is_by_key)
        imgui.separator()
        frame, n_clips = ui.timeline.menu_frame, len(session.clips)
        draw_cutting(session, dispatch, ui, clip, frame_index=frame, n_clips=n_clips)
        imgui.separator()
        _draw_time(clip, session, dispatch, ui)
        imgui.separator()
        draw_label_field(session, dispatch, ui, "clip", str(clip.start))
    imgui.end_popup()


def _draw_time(clip: Clip, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    timeline = session.timeline
    if _item(ui, "go", f"{Icon.PLAY}  Go to first frame"):
        dispatch(SetFrame(clip.start))
    if _item(ui, "range", f"{Icon.LOOP}  Play this clip only", "I, O"):
        timeline.set_range(clip.start, clip.stop - 1)
    has_range = timeline.in_frame is not None or timeline.out_frame is not None
    if _item(ui, "no range", f"{Icon.LOOP}  Play the whole capture", "X", is_enabled=has_range):
        timeline.clear_range()
    if clip.clip_index > 0 and _item(ui, "seam", f"{Icon.LOOP}  Play around its start", "/"):
        timeline.play_around(clip.start)
    if clip.clip_index > 0 and _item(ui, "mend", f"{Icon.MEND}  Mend the seam at its start", "Shift+M"):
        dispatch(AskMend(after=clip.clip_index))
    if _item(ui, "zoom", f"{Icon.EYE}  Show this clip only", "Z"):
        ui.timeline.show_clip(clip, timeline.n_frames)
    if _item(ui, "whole", f"{Icon.EYE}  Show the whole capture", "Z", is_enabled=ui.timeline.is_zoomed):
        ui.timeline.show_all()


def _item(ui: UiState, name: str, label: str, key_label: str = "", *, is_enabled: bool = True) -> bool:
    is_chosen = imgui.menu_item(label, key_label, False, is_enabled)[0]
    ui.mark(f"clip menu.{name}")
    return is_chosen
