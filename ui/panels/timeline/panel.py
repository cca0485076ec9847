"""The timeline as a whole: rows from top to bottom, and the boxes over them."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.timeline.jump_text import HINT, parse_jump
from ui.panels.timeline.key_lanes.path_lane import draw_path_lane
from ui.panels.timeline.key_lanes.volume_lane import draw_volume_lane, keyed_edit
from ui.panels.timeline.marker_box import draw_marker_box
from ui.panels.timeline.menu import draw_clip_menu
from ui.panels.timeline.pointer import handle_track
from ui.panels.timeline.rows.clip_lane import draw_clip_lane
from ui.panels.timeline.rows.gutter import WIDTH as GUTTER_WIDTH
from ui.panels.timeline.rows.gutter import draw_gutter
from ui.panels.timeline.rows.object_lane import draw_object_lane
from ui.panels.timeline.rows.overview import draw_overview
from ui.panels.timeline.rows.quality_lane import draw_quality_lane
from ui.panels.timeline.rows.rows import (
    CACHE,
    CAMERA,
    MARKERS,
    MIN_TRACK_HEIGHT,
    OBJECTS,
    OVERVIEW,
    QUALITY,
    RULER,
    SEAMS,
    TAKE,
    VOLUMES,
    arrange_rows,
)
from ui.panels.timeline.rows.ruler import draw_hover, draw_played, draw_playhead, draw_ruler
from ui.panels.timeline.rows.seam_lane import draw_seam_lane
from ui.panels.timeline.rows.small_lanes import draw_cache_lane, draw_marker_lane
from ui.panels.timeline.rows.stage import TimelineStage
from ui.panels.timeline.rows.take_lane import draw_take_lane
from ui.panels.timeline.time_range import TimeScale
from ui.panels.timeline.transport import draw_transport
from ui.style import theme


def draw_timeline(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Transport row, then the rows of time."""
    if session.capture is None:
        imgui.text_disabled("Frames and clips appear here when a capture is open.")
        return
    ui.timeline.take_up(session.capture, session.timeline)
    if imgui.get_content_region_avail().y >= MIN_TRACK_HEIGHT + imgui.get_frame_height_with_spacing():
        draw_transport(session, dispatch, ui)  # in a lower panel it gives way: time is worth more than buttons
    _draw_rows(session, dispatch, ui)


def _draw_rows(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    origin, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    left, right = origin.x + GUTTER_WIDTH, origin.x + max(size.x, GUTTER_WIDTH + 1.0)
    folded = ui.timeline.folded | (set() if session.paths.paths else {CAMERA})
    folded |= {VOLUMES} if keyed_edit(session, ui) is None else set()
    is_zoomed, objects = ui.timeline.is_zoomed, session.edits.objects
    folded = folded if session.edits.timing else folded | {TAKE}
    rows = {
        row.name: Rect(left, origin.y + row.top, right, origin.y + row.top + row.height)
        for row in arrange_rows(max(size.y, MIN_TRACK_HEIGHT), folded, is_zoomed=is_zoomed, n_objects=len(objects))
    }
    overview = rows.get(OVERVIEW)
    track = Rect(left, rows[RULER].y0, right, max(row.y1 for row in rows.values()))
    stage = _stage(session, ui, track, rows)
    if overview is not None:
        draw_overview(stage, overview, session)
    draw_gutter(rows, origin.x, session, ui)
    imgui.set_cursor_screen_pos(track.low)
    imgui.invisible_button("track", ImVec2(track.width, track.height))
    ui.mark_rect("timeline.track", track)
    if imgui.is_item_hovered():
        pointer = imgui.get_io().mouse_pos
        stage = _stage(session, ui, track, rows, (pointer.x, pointer.y))
    handle_track(stage, session, dispatch)
    draw_clip_menu(stage, session, dispatch)
    _draw_track(stage, session)
    draw_jump_box(session, dispatch, ui, track)
    draw_marker_box(session.timeline, dispatch, ui, track)


def _stage(
    session: SessionView,
    ui: UiState,
    track: Rect,
    rows: dict[str, Rect],
    pointer: tuple[float, float] | None = None,
) -> TimelineStage:
    n_frames = session.timeline.n_frames
    scale = TimeScale(track.x0, track.x1, ui.timeline.range_of(n_frames), n_frames)
    return TimelineStage(imgui.get_window_draw_list(), scale, track, rows, pointer, ui)


def _draw_track(stage: TimelineStage, session: SessionView) -> None:
    draw, track, timeline = stage.draw, stage.track, session.timeline
    draw.add_rect_filled(track.low, track.high, theme.u32(theme.BACKDROP), 4)
    draw.push_clip_rect(track.low, track.high, True)
    draw_clip_lane(stage, session)
    if SEAMS in stage.rows:
        draw_seam_lane(stage, session)
    if QUALITY in stage.rows:
        draw_quality_lane(stage, session)
    if CACHE in stage.rows:
        draw_cache_lane(stage, session)
    if CAMERA in stage.rows:
        draw_path_lane(stage, session)
    if OBJECTS in stage.rows:
        draw_object_lane(stage, session)
    if VOLUMES in stage.rows:
        draw_volume_lane(stage, session)
    if TAKE in stage.rows:
        draw_take_lane(stage, session)
    if MARKERS in stage.rows:
        draw_marker_lane(stage, timeline)
    draw_played(stage, timeline)
    draw_ruler(stage, timeline)
    draw_hover(stage, timeline)
    draw_playhead(stage, timeline)
    draw.pop_clip_rect()


JUMP_POPUP = "go to"
JUMP_WIDTH = 260.0


def draw_jump_box(session: SessionView, dispatch: Dispatch, ui: UiState, track: Rect) -> None:
    """Opens where it is wanted, just above the track. Enter goes there; the box stays where there is something to say
    of that, until Enter comes again or Escape."""
    view, timeline = ui.timeline, session.timeline
    is_new = view.is_jump_wanted
    if is_new:
        view.is_jump_wanted = False
        view.jump_text = view.jump_words = ""
        imgui.open_popup(JUMP_POPUP)
    imgui.set_next_window_pos(ImVec2(track.x0 + 12, track.y0), imgui.Cond_.appearing, ImVec2(0, 1))
    if not imgui.begin_popup(JUMP_POPUP):
        return
    imgui.text_unformatted("Go to")
    imgui.same_line()
    imgui.set_next_item_width(JUMP_WIDTH)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    is_entered, view.jump_text = imgui.input_text_with_hint("##time", HINT, view.jump_text, flags)
    ui.mark("timeline.jump")
    if is_entered:
        jump = parse_jump(view.jump_text, timeline.frame_index, session.clips, timeline.fps)
        is_told = bool(jump.words) and jump.words == view.jump_words and jump.frame_index is not None
        view.jump_words = jump.words
        if jump.frame_index is not None:
            dispatch(SetFrame(jump.frame_index))
        if not jump.words or is_told:
            imgui.close_current_popup()
        else:
            imgui.set_keyboard_focus_here(-1)
    if view.jump_words:
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.YELLOW))
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + JUMP_WIDTH + 40)
        imgui.text_unformatted(view.jump_words)
        imgui.pop_text_wrap_pos()
        imgui.pop_style_color()
        ui.mark("timeline.jump words")
    if imgui.is_key_pressed(imgui.Key.escape, False):
        imgui.close_current_popup()
    imgui.end_popup()
