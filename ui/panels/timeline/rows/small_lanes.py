"""The low lanes: which frames are decoded in memory, and the user's markers."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.document.project_document import Marker
from app.playback.timeline import Timeline
from app.session.session_view import SessionView
from ui.panels.pieces.widgets import elided
from ui.panels.state import Rect
from ui.panels.timeline.rows.columns import merged_spans
from ui.panels.timeline.rows.rows import CACHE, MARKERS
from ui.panels.timeline.rows.stage import SMALL_TEXT, TimelineStage, small_text, small_width
from ui.style import theme

STRIP_HEIGHT = 5.0
MARKER_HALF = 5.0
MIN_MARKER_DISTANCE = 3.0
"""Markers closer to each other than this are drawn as one."""
MAX_NAME_WIDTH = 220.0


def draw_cache_lane(stage: TimelineStage, session: SessionView) -> None:
    """A strip under every frame that can be shown at once."""
    row, scale = stage.rows[CACHE], stage.scale
    middle = (row.y0 + row.y1) / 2
    strip = Rect(scale.x0, middle - STRIP_HEIGHT / 2, scale.x1, middle + STRIP_HEIGHT / 2)
    stage.draw.add_rect_filled(strip.low, strip.high, theme.u32(theme.faded(theme.TEXT, 0.06)), 2)
    runs = np.asarray(session.cached_frames(), np.float64).reshape(-1, 2)
    if not len(runs):
        return
    in_sight = runs[(runs[:, 1] > scale.shown.start) & (runs[:, 0] < scale.shown.stop)]
    edges = scale.x0 + (in_sight - scale.shown.start) * scale.per_frame
    color = theme.u32(theme.SKY)
    for x0, x1 in merged_spans(edges[:, 0], edges[:, 1], 1.0):
        low = ImVec2(max(x0, scale.x0), strip.y0)
        stage.draw.add_rect_filled(low, ImVec2(min(max(x1, x0 + 1), scale.x1), strip.y1), color, 2)


def draw_marker_lane(stage: TimelineStage, timeline: Timeline) -> None:
    """A diamond per marker, with its name where there is room."""
    scale = stage.scale
    markers = timeline.markers.between(scale.shown.start, scale.shown.stop)
    for place, marker in enumerate(markers):
        x = scale.middle_of(marker.frame_index)
        if place and x - scale.middle_of(markers[place - 1].frame_index) < MIN_MARKER_DISTANCE:
            continue
        room = (scale.x1 if place + 1 == len(markers) else scale.middle_of(markers[place + 1].frame_index)) - x
        _draw_marker(stage, marker, x, room - 2 * MARKER_HALF - 6)
    pointed = marker_at(stage, timeline)
    if pointed is not None:
        imgui.begin_tooltip()
        imgui.text_unformatted(f"Marker at frame {pointed.frame_index}")
        if pointed.text:
            imgui.text_unformatted(pointed.text)
        imgui.end_tooltip()


def _draw_marker(stage: TimelineStage, marker: Marker, x: float, room: float) -> None:
    row = stage.rows[MARKERS]
    y = (row.y0 + row.y1) / 2
    half = MARKER_HALF
    stage.ui.mark_rect(f"timeline.marker{marker.frame_index}", Rect(x - half, y - half, x + half, y + half))
    stage.draw.add_quad_filled(
        ImVec2(x, y - half), ImVec2(x + half, y), ImVec2(x, y + half), ImVec2(x - half, y), theme.u32(theme.YELLOW)
    )
    if marker.text and room > 16:
        name = " ".join(marker.text.split("\n"))
        if small_width(name) > min(room, MAX_NAME_WIDTH):
            name = elided(name, min(room, MAX_NAME_WIDTH) * imgui.get_font_size() / SMALL_TEXT)
        small_text(stage.draw, x + half + 4, y - 7, name, theme.TEXT)


def marker_at(stage: TimelineStage, timeline: Timeline) -> Marker | None:
    """The marker under the pointer."""
    if not stage.is_pointed_at(MARKERS) or stage.pointer is None:
        return None
    position = stage.scale.position_at(stage.pointer[0])
    reach = max((MARKER_HALF + 2) / stage.scale.per_frame, 0.5)
    near = timeline.markers.between(position - reach - 0.5, position + reach - 0.5 + 1e-9)
    return min(near, key=lambda marker: abs(marker.frame_index + 0.5 - position), default=None)
