"""The overview: the whole capture in a low strip while the rows below show a part of it, which can be dragged here."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.playback.timeline import Timeline
from app.session.session_view import SessionView
from ui.panels.state import Rect
from ui.panels.timeline.rows.clip_lane import state_runs
from ui.panels.timeline.rows.stage import TimelineStage
from ui.panels.timeline.time_range import TimeRange, TimeScale, whole_range
from ui.panels.timeline.view_state import TimelineView
from ui.style import theme

MIN_RUN_WIDTH = 4.0
MIN_WINDOW_WIDTH = 8.0
"""The part that is shown is drawn no narrower, so that it can be taken hold of."""


def draw_overview(stage: TimelineStage, row: Rect, session: SessionView) -> None:
    """States of all clips, the part that is shown, and the playhead; dragging moves that part."""
    timeline, draw = session.timeline, stage.draw
    whole = TimeScale(row.x0, row.x1, whole_range(timeline.n_frames), timeline.n_frames)
    imgui.set_cursor_screen_pos(row.low)
    imgui.invisible_button("overview", ImVec2(max(row.width, 1.0), max(row.height, 1.0)))
    stage.ui.mark_rect("timeline.overview", row)
    _drag(stage.ui.timeline, whole, timeline)
    draw.add_rect_filled(row.low, row.high, theme.u32(theme.BACKDROP), 3)
    if session.clip_states and session.clips:
        for first, last, state in state_runs(
            session, replace(stage, scale=whole), (0, len(session.clip_states)), MIN_RUN_WIDTH
        ):
            x0, x1 = whole.left_of(session.clips[first].start), whole.left_of(session.clips[last].stop)
            color = theme.u32(theme.faded(theme.status_color(state), 0.75))
            draw.add_rect_filled(ImVec2(x0, row.y0 + 5), ImVec2(max(x1, x0 + 1), row.y1 - 5), color)
    window = window_rect(stage.ui.timeline.range_of(timeline.n_frames), whole, row)
    draw.add_rect_filled(window.low, window.high, theme.u32(theme.faded(theme.TEXT, 0.14)), 3)
    draw.add_rect(window.low, window.high, theme.u32(theme.faded(theme.TEXT, 0.8)), 3)
    stage.ui.mark_rect("timeline.window", window)
    draw.add_line_v(whole.middle_of(timeline.frame_index), row.y0, row.y1, theme.u32(theme.PLAYHEAD), 2)


def window_rect(shown: TimeRange, whole: TimeScale, row: Rect) -> Rect:
    """Where the part that is shown lies in the overview."""
    x0, x1 = whole.left_of(shown.start), whole.left_of(shown.stop)
    missing = max(MIN_WINDOW_WIDTH - (x1 - x0), 0.0) / 2
    return Rect(max(x0 - missing, row.x0), row.y0, min(x1 + missing, row.x1), row.y1)


def _drag(view: TimelineView, whole: TimeScale, timeline: Timeline) -> None:
    """Hold the window where it was taken, or bring its middle under the pointer where it was pressed outside of it."""
    if not (imgui.is_item_active() or imgui.is_item_deactivated()):
        view.overview_grip = None
        return
    at, shown = whole.position_at(imgui.get_io().mouse_pos.x), view.range_of(timeline.n_frames)
    if view.overview_grip is None:
        is_inside = shown.start <= at <= shown.stop
        view.overview_grip = at - shown.start if is_inside else shown.length / 2
    start = at - view.overview_grip
    view.show(TimeRange(start, start + shown.length).within(timeline.n_frames), timeline.n_frames)
