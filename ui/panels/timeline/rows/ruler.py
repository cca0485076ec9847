"""The ruler: ticks in the chosen unit, the frames played, the playhead, and a line under the pointer."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.playback.timeline import Timeline
from ui.panels.state import Rect
from ui.panels.timeline.rows.rows import RULER
from ui.panels.timeline.rows.stage import TimelineStage
from ui.panels.timeline.units import format_time, ruler_ticks
from ui.style import theme

MIN_FRAME_WIDTH = 7.0
"""Narrower frames have no tick of their own."""
FLAG_HEIGHT = 18.0
BRACKET = 5.0


def draw_ruler(stage: TimelineStage, timeline: Timeline) -> None:
    """Ticks and labels."""
    row, scale, draw = stage.rows[RULER], stage.scale, stage.draw
    flag = flag_rect(stage, timeline)
    if scale.per_frame >= MIN_FRAME_WIDTH:
        color = theme.u32(theme.OUTLINE)
        for frame_index in range(int(scale.shown.start), min(int(scale.shown.stop) + 1, scale.n_frames) + 1):
            draw.add_line_v(scale.left_of(frame_index), row.y1 - 5, row.y1 - 1, color)
    ticks = ruler_ticks(scale.shown, scale.width, timeline.fps, stage.ui.timeline.unit, scale.n_frames)
    for position, label in zip(ticks.positions, ticks.labels, strict=True):
        x = scale.left_of(position)
        draw.add_line_v(x, row.y0 + 6, row.y1 - 1, theme.u32(theme.RAISED_ACTIVE))
        is_clear = x > flag.x1 or x + imgui.calc_text_size(label).x + 12 < flag.x0
        if is_clear and x >= scale.x0 - 4:  # half hidden it would read as another number
            draw.add_text(ImVec2(x + 4, row.y0 + 2), theme.u32(theme.TEXT_DIM), label)


def draw_played(stage: TimelineStage, timeline: Timeline) -> None:
    """The played range, unless it is everything: a bar with an end on either side, and the rest dimmed."""
    if timeline.around is None and timeline.in_frame is None and timeline.out_frame is None:
        return
    row, scale, draw, track = stage.rows[RULER], stage.scale, stage.draw, stage.track
    first, last = timeline.play_range
    x0, x1 = scale.left_of(first), scale.left_of(last + 1)
    shade = theme.u32(theme.SHADE)
    draw.add_rect_filled(track.low, ImVec2(min(max(x0, track.x0), track.x1), track.y1), shade)
    draw.add_rect_filled(ImVec2(min(max(x1, track.x0), track.x1), track.y0), track.high, shade)
    color = theme.u32(theme.SKY if timeline.around is None else theme.ORANGE)
    draw.add_rect_filled(ImVec2(x0, row.y1 - 3), ImVec2(x1, row.y1), color)
    for x, toward in ((x0, 1.0), (x1, -1.0)):
        draw.add_line_v(x, row.y0 + 3, row.y1, color, 2)
        draw.add_line_h(min(x, x + toward * BRACKET), max(x, x + toward * BRACKET), row.y0 + 3, color, 2)


def draw_hover(stage: TimelineStage, timeline: Timeline) -> None:
    """A line through the frame under the pointer."""
    if stage.pointer is None:
        return
    frame_index = stage.scale.frame_at(stage.pointer[0])
    if frame_index != timeline.frame_index:
        x = stage.scale.middle_of(frame_index)
        stage.draw.add_line_v(x, stage.track.y0, stage.track.y1, theme.u32(theme.faded(theme.TEXT, 0.25)))


def draw_playhead(stage: TimelineStage, timeline: Timeline) -> None:
    """The frame that is shown, as a line with a flag; nothing where it is out of sight."""
    scale, track = stage.scale, stage.track
    left, right = scale.left_of(timeline.frame_index), scale.left_of(timeline.frame_index + 1)
    if right < track.x0 or left > track.x1:
        return
    white = theme.u32(theme.PLAYHEAD)
    top = stage.rows[RULER].y1
    tint = theme.u32(theme.faded(theme.PLAYHEAD, 0.10))
    stage.draw.add_rect_filled(ImVec2(left, top), ImVec2(right, track.y1), tint)
    stage.draw.add_line_v((left + right) / 2, track.y0 + 10, track.y1, white, 2)
    flag = flag_rect(stage, timeline)
    stage.draw.add_rect_filled(flag.low, flag.high, white, 3)
    stage.draw.add_text(
        ImVec2(flag.x0 + 6, track.y0 + 1), theme.u32(theme.TEXT_ON_PLAYHEAD), _flag_text(stage, timeline)
    )
    stage.ui.mark_rect("timeline.playhead", flag)


def flag_rect(stage: TimelineStage, timeline: Timeline) -> Rect:
    """Where the playhead's number stands; held inside the track."""
    track = stage.track
    half = imgui.calc_text_size(_flag_text(stage, timeline)).x / 2 + 6
    middle = min(max(stage.scale.middle_of(timeline.frame_index), track.x0 + half), track.x1 - half)
    return Rect(middle - half, track.y0, middle + half, track.y0 + FLAG_HEIGHT)


def _flag_text(stage: TimelineStage, timeline: Timeline) -> str:
    return format_time(timeline.frame_index, timeline.fps, stage.ui.timeline.unit)
