"""The row of buttons: where the playhead is, and how it plays."""

from __future__ import annotations

from fractions import Fraction

from imgui_bundle import ImVec2, imgui

from app.playback.timeline import SPEEDS, Timeline
from app.session.session_view import SessionView
from app.session.showing.look_commands import FollowTraining, TogglePlay
from engine.text import rate_text
from ui.panels.actions.time import go_to_frame
from ui.panels.pieces.widgets import text_right
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.clip_words import clip_title
from ui.panels.timeline.units import FRAMES, SECONDS, format_time
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.theme import Icon

ROOM_FOR_RATE = 1040.0
"""In a row narrower than this the capture's frame rate is not said."""


def speed_text(speed: float) -> str:
    """A multiple of the capture's own speed: "1/8x"."""
    return f"{Fraction(speed).limit_denominator(8)}x"


def draw_transport(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Buttons, the frame's number, the frames played, and the clip at the right end."""
    timeline = session.timeline
    width = imgui.get_content_region_avail().x
    _draw_buttons(session, dispatch, ui)
    imgui.same_line(0, 16)
    imgui.align_text_to_frame_padding()
    imgui.text_disabled("Frame")
    imgui.same_line()
    imgui.set_next_item_width(64)
    imgui.push_item_flag(imgui.ItemFlags_.no_tab_stop, True)  # Tab shows and hides marks; it must not land here
    is_edited, typed = imgui.input_int("##frame", timeline.frame_index, 0, 0)
    imgui.pop_item_flag()
    ui.mark("timeline.frame")
    if is_edited:
        go_to_frame(timeline, dispatch, typed)
    imgui.same_line()
    imgui.text_disabled(f"of 0 to {format_count(timeline.last_frame)}")
    imgui.same_line(0, 18)
    imgui.text(
        format_time(timeline.frame_index, timeline.fps, SECONDS if ui.timeline.unit == FRAMES else ui.timeline.unit)
    )
    if width >= ROOM_FOR_RATE:
        imgui.same_line()
        imgui.text_disabled(f"at {rate_text(timeline.fps)} frames per second")
    words = played_words(timeline)
    if words:
        imgui.same_line(0, 18)
        imgui.text_disabled(words)
        ui.mark("timeline.played")
    clip = timeline.clip
    if clip is not None:
        text_right(f"{clip_title(clip.clip_index, session.reference_index)}, frames {clip.start} to {clip.stop - 1}")


def played_words(timeline: Timeline) -> str:
    """The played range, unless it is the whole capture."""
    route = timeline.route
    if route is not None and timeline.timing is not None:
        return f"take {route.output} of {timeline.timing.n_output}"
    if timeline.around is not None:
        return f"around frames {timeline.around[0]} to {timeline.around[1]}"
    ends = (("in", timeline.in_frame), ("out", timeline.out_frame))
    return "  ".join(f"{name} {frame_index}" for name, frame_index in ends if frame_index is not None)


def _draw_buttons(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    timeline = session.timeline
    if _icon_button(ui, "first", Icon.FIRST, "First frame (Home)"):
        go_to_frame(timeline, dispatch, 0)
    if _icon_button(ui, "back", Icon.STEP_BACK, "One frame back (Left)"):
        go_to_frame(timeline, dispatch, timeline.frame_index - 1)
    icon, tooltip = (Icon.PAUSE, "Pause (Space)") if timeline.is_playing else (Icon.PLAY, "Play (Space)")
    if _icon_button(
        ui, "play", icon, f"{tooltip}; J, K and L play backward, stop, and play forward", is_on=timeline.is_playing
    ):
        dispatch(TogglePlay())
    if _icon_button(ui, "forward", Icon.STEP_FORWARD, "One frame forward (Right)"):
        go_to_frame(timeline, dispatch, timeline.frame_index + 1)
    if _icon_button(ui, "last", Icon.LAST, "Last frame (End)"):
        go_to_frame(timeline, dispatch, timeline.n_frames - 1)
    if _icon_button(ui, "loop", Icon.LOOP, "Loop (Ctrl+/)", is_on=timeline.is_looping):
        timeline.is_looping = not timeline.is_looping
    if timeline.timing is not None:
        take_note = "Play the take as it is edited in time (Alt+P)"
        if _icon_button(ui, "take", Icon.FILM, take_note, is_on=timeline.is_take):
            timeline.is_take = not timeline.is_take
    follow_note = "Follow training: stay in the clip with the newest state (End twice)"
    if _icon_button(ui, "follow", Icon.FOLLOW, follow_note, is_on=timeline.is_following):
        dispatch(FollowTraining(not timeline.is_following))
    _draw_speed(timeline, ui)


def _draw_speed(timeline: Timeline, ui: UiState) -> None:
    imgui.set_next_item_width(66)
    imgui.push_item_flag(imgui.ItemFlags_.no_tab_stop, True)
    is_open = imgui.begin_combo("##speed", speed_text(timeline.speed * timeline.direction))
    imgui.pop_item_flag()
    if is_open:
        for speed in reversed(SPEEDS):
            if imgui.selectable(speed_text(speed), speed == timeline.speed)[0]:
                timeline.speed = speed
            ui.mark(f"speed.{speed:g}")
        imgui.end_combo()
    else:
        ui.mark("timeline.speed")
        imgui.set_item_tooltip("Playback speed (Shift+, and Shift+.)")
    imgui.same_line(0, 4)


def _icon_button(ui: UiState, name: str, icon: str, tooltip: str, *, is_on: bool = False) -> bool:
    if is_on:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.SKY))
    is_clicked = imgui.button(f"{icon}##{name}", ImVec2(36, 0))
    if is_on:
        imgui.pop_style_color()
    ui.mark(f"timeline.{name}")
    imgui.set_item_tooltip(tooltip)
    imgui.same_line(0, 4)
    return is_clicked
