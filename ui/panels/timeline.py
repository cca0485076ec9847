"""The timeline: transport buttons, ruler, one band per clip with its state, playhead. Dragging anywhere scrubs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from imgui_bundle import ImVec2, imgui

from app.playback.timeline import Timeline
from app.session.commands import SetFrame, TogglePlay
from app.status import ClipStatus, TrainingStatus
from engine.capture.clip import Clip
from ui.panels.actions.time import go_to_frame
from ui.panels.clip_training_menu import ClipMenuNeeds, draw_clip_training
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.widgets import text_right
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.progress_words import band_words
from ui.style.theme import Icon

RULER_HEIGHT = 22.0
MIN_TRACK_HEIGHT = RULER_HEIGHT + 18.0
MIN_TICK_SPACING_PX = 56.0
NOTE_WIDTH = 380.0
MIN_BAND_WIDTH = 4.0
"""Clips narrower than this are drawn in runs."""

STATE_WORDS: dict[str, str] = {
    "untrained": "not trained",
    "queued": "waiting",
    "preparing": "preparing",
    "training": "training",
    "paused": "paused",
    "stopped": "stopped",
    "trained": "trained",
    "failed": "failed",
    "stale": "out of date",
    "damaged": "damaged",
}


class TimelineNeeds(ClipMenuNeeds, Protocol):
    """What this panel reads."""

    @property
    def capture(self) -> object | None: ...

    @property
    def timeline(self) -> Timeline: ...

    @property
    def clips(self) -> Sequence[Clip]: ...

    @property
    def clip_states(self) -> Sequence[ClipStatus]: ...

    @property
    def training(self) -> TrainingStatus: ...

    @property
    def reference_index(self) -> int: ...


def state_note(status: ClipStatus) -> str:
    """What there is to say of a clip's state beyond its word; empty where that says it all."""
    texts = [status.reason]
    if status.resume_step is not None and status.state in ("trained", "stale", "damaged"):
        texts.append(f"It was being trained again: that was stopped at step {format_count(status.resume_step)}.")
    elif status.resume_step is not None and status.state in ("stopped", "failed"):
        texts.append(f"Its training goes on at step {format_count(status.resume_step)}.")
    return " ".join(text for text in texts if text)


def tick_step(frames: int, width_px: float) -> int:
    """Frames between labelled ticks: 1, 2 or 5 times a power of ten, labels about MIN_TICK_SPACING_PX apart."""
    smallest = max(frames * MIN_TICK_SPACING_PX / max(width_px, 1.0), 1.0)
    power = 10 ** math.floor(math.log10(smallest))
    for factor in (1, 2, 5):
        if factor * power >= smallest:
            return int(factor * power)
    return int(10 * power)


def frame_at(x: float, track: Rect, n_frames: int) -> int:
    """Frame whose cell lies under x, held inside the capture."""
    if n_frames < 1:
        return 0
    share = (x - track.x0) / max(track.width, 1.0)
    return min(max(math.floor(share * n_frames), 0), n_frames - 1)


def cell_left(frame_index: float, track: Rect, n_frames: int) -> float:
    """Left edge of a frame's cell."""
    return track.x0 + track.width * frame_index / max(n_frames, 1)


def draw_timeline(session: TimelineNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """Transport row, then the track."""
    if session.capture is None:
        imgui.text_disabled("Frames and clips appear here when a capture is open.")
        return
    if imgui.get_content_region_avail().y >= MIN_TRACK_HEIGHT + imgui.get_frame_height_with_spacing():
        _draw_transport(session, dispatch, ui)  # in a lower panel it gives way: time is worth more than buttons
    _draw_track(session, dispatch, ui)


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


def _draw_transport(session: TimelineNeeds, dispatch: Dispatch, ui: UiState) -> None:
    timeline = session.timeline
    if _icon_button(ui, "first", Icon.FIRST, "First frame (Home)"):
        go_to_frame(timeline, dispatch, 0)
    if _icon_button(ui, "back", Icon.STEP_BACK, "One frame back (Left)"):
        go_to_frame(timeline, dispatch, timeline.frame_index - 1)
    icon, tooltip = (Icon.PAUSE, "Pause (Space)") if timeline.is_playing else (Icon.PLAY, "Play (Space)")
    if _icon_button(ui, "play", icon, tooltip, is_on=timeline.is_playing):
        dispatch(TogglePlay())
    if _icon_button(ui, "forward", Icon.STEP_FORWARD, "One frame forward (Right)"):
        go_to_frame(timeline, dispatch, timeline.frame_index + 1)
    if _icon_button(ui, "last", Icon.LAST, "Last frame (End)"):
        go_to_frame(timeline, dispatch, timeline.n_frames - 1)
    if _icon_button(ui, "loop", Icon.LOOP, "Loop (L)", is_on=timeline.is_looping):
        timeline.is_looping = not timeline.is_looping
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
    fps = max(timeline.fps, 1e-6)
    imgui.text(f"{timeline.frame_index / fps:.2f} s")
    imgui.same_line()
    imgui.text_disabled(f"at {timeline.fps:g} frames per second")
    clip = timeline.clip_of(timeline.frame_index)
    if clip is not None:
        label = f"{_clip_title(clip.clip_index, session)}, frame {timeline.frame_index - clip.start}"
        text_right(label)


def _clip_title(clip_index: int, session: TimelineNeeds) -> str:
    return f"Clip {clip_index}" + (", reference" if clip_index == session.reference_index else "")


def _draw_track(session: TimelineNeeds, dispatch: Dispatch, ui: UiState) -> None:
    timeline = session.timeline
    origin = imgui.get_cursor_screen_pos()
    size = imgui.get_content_region_avail()
    size.x, size.y = max(size.x, 1.0), max(size.y, MIN_TRACK_HEIGHT)
    imgui.invisible_button("track", size)
    track = Rect(origin.x, origin.y, origin.x + size.x, origin.y + size.y)
    ui.mark_rect("timeline.track", track)
    # A quick drag's last stretch arrives in the same frame as the release, when the item is active no more.
    if imgui.is_item_active() or imgui.is_item_deactivated():
        frame_index = frame_at(imgui.get_io().mouse_pos.x, track, timeline.n_frames)
        if frame_index != timeline.frame_index:
            dispatch(SetFrame(frame_index))
    hovered = frame_at(imgui.get_io().mouse_pos.x, track, timeline.n_frames) if imgui.is_item_hovered() else None
    _draw_menu(session, dispatch, ui, track)

    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(track.low, track.high, theme.u32(theme.BACKDROP), 4)
    draw.push_clip_rect(track.low, track.high, True)
    band_top = track.y0 + RULER_HEIGHT
    band_bottom = min(track.y1 - 6, band_top + 52)
    for first, last in band_runs(session, track):
        x0 = cell_left(session.clips[first].start, track, timeline.n_frames) + 1
        x1 = cell_left(session.clips[last].stop, track, timeline.n_frames) - 1
        band = Rect(x0, band_top, max(x1, x0 + 1), band_bottom)
        ui.mark_rect(f"timeline.clip{first}", band)
        if first == last:
            _draw_band(draw, band, session, session.clips[first], session.clip_states[first], ui)
        else:
            _draw_run(draw, band, first, last, session.clip_states[first].state)
    _draw_ruler(draw, track, timeline.n_frames, timeline.frame_index)
    if hovered is not None and imgui.get_io().mouse_pos.y >= band_top:
        _draw_note(session, hovered)
    if hovered is not None and hovered != timeline.frame_index:
        _draw_hover(draw, track, hovered, timeline.n_frames)
    _draw_playhead(draw, track, timeline.frame_index, timeline.n_frames, ui)
    draw.pop_clip_rect()


def band_runs(session: TimelineNeeds, track: Rect) -> list[tuple[int, int]]:
    """First and last clip of every band: one clip each, or where that is too narrow to see, a run in one state."""
    n_clips = min(len(session.clips), len(session.clip_states))
    if n_clips and track.width / n_clips >= MIN_BAND_WIDTH:
        return [(index, index) for index in range(n_clips)]
    starts = [
        index
        for index in range(n_clips)
        if index == 0 or session.clip_states[index].state != session.clip_states[index - 1].state
    ]
    return [(first, after - 1) for first, after in zip(starts, [*starts[1:], n_clips], strict=True)]


def _draw_run(draw: imgui.ImDrawList, band: Rect, first: int, last: int, state: str) -> None:
    """Many clips in one state as one band."""
    color = theme.status_color(state)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.RAISED), 3)
    draw.push_clip_rect(band.low, band.high, True)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.38 if state == "trained" else 0.22)), 3)
    if state in ("failed", "stale", "damaged", "stopped"):
        _hatch(draw, band, theme.faded(color, 0.55), 7.0, is_crossed=state == "damaged")
    draw.add_rect_filled(ImVec2(band.x0, band.y1 - 3), band.high, theme.u32(color), 2)
    if band.width >= 60:
        words = f"{theme.CLIP_ICONS.get(state, '')}  {STATE_WORDS.get(state, state)}"
        draw.add_text(ImVec2(band.x0 + 9, band.y0 + 6), theme.u32(theme.TEXT), f"Clips {first} to {last}")
        draw.add_text(ImVec2(band.x0 + 9, band.y0 + 25), theme.u32(theme.TEXT), words.strip())
    draw.pop_clip_rect()


def _draw_note(session: TimelineNeeds, frame_index: int) -> None:
    """The reason of a clip's state, where the pointer is over its band."""
    clip = session.timeline.clip_of(frame_index)
    note = "" if clip is None else state_note(session.clip_states[clip.clip_index])
    if note and clip is not None:
        state = session.clip_states[clip.clip_index].state
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(NOTE_WIDTH)
        imgui.text_wrapped(f"{_clip_title(clip.clip_index, session)}: {STATE_WORDS.get(state, state)}. {note}")
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def _draw_menu(session: TimelineNeeds, dispatch: Dispatch, ui: UiState, track: Rect) -> None:
    imgui.open_popup_on_item_click("clip menu", imgui.PopupFlags_.mouse_button_right)
    if not imgui.begin_popup("clip menu"):
        return
    opened_at = imgui.get_mouse_pos_on_opening_current_popup()
    clip = session.timeline.clip_of(frame_at(opened_at.x, track, session.timeline.n_frames))
    if clip is not None:
        clip_index = clip.clip_index
        state = session.clip_states[clip_index].state
        imgui.text_disabled(f"{_clip_title(clip_index, session)}: {STATE_WORDS.get(state, state)}")
        imgui.separator()
        draw_clip_training(session, dispatch, ui, clip_index)
        if imgui.menu_item(f"{Icon.PLAY}  Go to its first frame", "", False, True)[0]:
            dispatch(SetFrame(session.clips[clip_index].start))
    imgui.end_popup()


def _draw_band(
    draw: imgui.ImDrawList, band: Rect, session: TimelineNeeds, clip: Clip, status: ClipStatus, ui: UiState
) -> None:
    state = status.state
    color = theme.status_color(state)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.RAISED), 3)
    draw.push_clip_rect(band.low, band.high, True)
    if state == "trained":
        draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.38)), 3)
    elif state in ("preparing", "training", "paused", "stopped"):
        share = min(max(float(status.progress), 0.0), 1.0)
        filled = ImVec2(band.x0 + band.width * share, band.y1)
        draw.add_rect_filled(band.low, filled, theme.u32(theme.faded(color, 0.38)), 3)
        _hatch(draw, Rect(filled.x, band.y0, band.x1, band.y1), theme.faded(color, 0.16), 10.0)
    elif state in ("failed", "stale"):
        draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.22)), 3)
        _hatch(draw, band, theme.faded(color, 0.55), 7.0)
    elif state == "damaged":
        draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.22)), 3)
        _hatch(draw, band, theme.faded(color, 0.55), 7.0, is_crossed=True)
    elif state == "queued":
        _hatch(draw, band, theme.faded(color, 0.28), 14.0)
    draw.add_rect_filled(ImVec2(band.x0, band.y1 - 3), band.high, theme.u32(color), 2)
    _draw_band_text(draw, band, session, clip, status, ui)
    draw.pop_clip_rect()


def _draw_band_text(
    draw: imgui.ImDrawList, band: Rect, session: TimelineNeeds, clip: Clip, status: ClipStatus, ui: UiState
) -> None:
    state = status.state
    icon = theme.CLIP_ICONS.get(state, "")
    title = _clip_title(clip.clip_index, session)
    words = band_words(status, session.training, clip.clip_index, STATE_WORDS.get(state, str(state)))
    if status.held_out_psnr is not None:
        words = f"{words}, {status.held_out_psnr:.1f} dB"
    x, y = band.x0 + 9, band.y0 + 6
    if band.width < 60:
        draw.add_text(ImVec2(band.x0 + 4, y), theme.u32(theme.TEXT), icon or str(clip.clip_index))
        return
    if imgui.calc_text_size(title).x + 18 > band.width:
        title = str(clip.clip_index)
    draw.add_text(ImVec2(x, y), theme.u32(theme.TEXT), title)
    line_two = f"{icon}  {words}" if icon else words
    if imgui.calc_text_size(line_two).x + 18 > band.width:
        line_two = icon or words
    if band.height > 40:
        draw.add_text(ImVec2(x, y + 19), theme.u32(theme.TEXT if state != "untrained" else theme.TEXT_DIM), line_two)


def _hatch(draw: imgui.ImDrawList, rect: Rect, color: theme.Color, spacing: float, *, is_crossed: bool = False) -> None:
    """Diagonal lines, one way or both; clipped to the rectangle."""
    if rect.width < 1:
        return
    packed = theme.u32(color)
    draw.push_clip_rect(rect.low, rect.high, True)
    x = rect.x0 - rect.height
    while x < rect.x1:
        draw.add_line(ImVec2(x, rect.y1), ImVec2(x + rect.height, rect.y0), packed, 1.5)
        if is_crossed:
            draw.add_line(ImVec2(x, rect.y0), ImVec2(x + rect.height, rect.y1), packed, 1.5)
        x += spacing
    draw.pop_clip_rect()


def _draw_ruler(draw: imgui.ImDrawList, track: Rect, n_frames: int, shown_frame: int) -> None:
    flag = _flag_rect(track, shown_frame, n_frames)
    step = tick_step(n_frames, track.width)
    is_each_frame_wide = track.width / max(n_frames, 1) >= 7
    if is_each_frame_wide:
        for frame_index in range(n_frames + 1):
            x = cell_left(frame_index, track, n_frames)
            draw.add_line_v(x, track.y0 + RULER_HEIGHT - 5, track.y0 + RULER_HEIGHT - 1, theme.u32(theme.OUTLINE))
    for frame_index in range(0, n_frames, step):
        x = cell_left(frame_index, track, n_frames)
        draw.add_line_v(x, track.y0 + 6, track.y0 + RULER_HEIGHT - 1, theme.u32(theme.RAISED_ACTIVE))
        label = str(frame_index)
        is_clear = x > flag.x1 or x + imgui.calc_text_size(label).x + 12 < flag.x0
        if is_clear:  # half hidden it would read as another number
            draw.add_text(ImVec2(x + 4, track.y0 + 2), theme.u32(theme.TEXT_DIM), label)


def _draw_hover(draw: imgui.ImDrawList, track: Rect, frame_index: int, n_frames: int) -> None:
    x = (cell_left(frame_index, track, n_frames) + cell_left(frame_index + 1, track, n_frames)) / 2
    draw.add_line_v(x, track.y0, track.y1, theme.u32(theme.faded(theme.TEXT, 0.25)))


def _draw_playhead(draw: imgui.ImDrawList, track: Rect, frame_index: int, n_frames: int, ui: UiState) -> None:
    left = cell_left(frame_index, track, n_frames)
    right = cell_left(frame_index + 1, track, n_frames)
    x = (left + right) / 2
    white = theme.u32(theme.PLAYHEAD)
    draw.add_rect_filled(
        ImVec2(left, track.y0 + RULER_HEIGHT), ImVec2(right, track.y1), theme.u32(theme.faded(theme.PLAYHEAD, 0.10))
    )
    draw.add_line_v(x, track.y0 + 10, track.y1, white, 2)
    flag = _flag_rect(track, frame_index, n_frames)
    draw.add_rect_filled(flag.low, flag.high, white, 3)
    draw.add_text(ImVec2(flag.x0 + 6, track.y0 + 1), theme.u32(theme.VOID), str(frame_index))
    ui.mark_rect("timeline.playhead", flag)


def _flag_rect(track: Rect, frame_index: int, n_frames: int) -> Rect:
    """Where the playhead's number stands; held inside the track."""
    x = (cell_left(frame_index, track, n_frames) + cell_left(frame_index + 1, track, n_frames)) / 2
    half = imgui.calc_text_size(str(frame_index)).x / 2 + 6
    middle = min(max(x, track.x0 + half), track.x1 - half)
    return Rect(middle - half, track.y0, middle + half, track.y0 + 18)
