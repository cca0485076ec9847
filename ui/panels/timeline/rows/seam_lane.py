"""The lane of seams: one mark per boundary between clips, on a fixed scale of 1 to 3. A click plays around it.

Height and colour say the same, from dark violet to light yellow; above SEAM_RATIO_FLAGGED a sign is added. Where not
all cameras of a boundary are measured, only its outline is drawn.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.playback.modes.color_maps import COLOR_MAPS, N_COLORS
from app.session.session_view import SessionView
from app.status import SEAM_RATIO_FLAGGED, SEAM_RATIO_RANGE
from ui.panels.state import Rect
from ui.panels.timeline.rows.clip_lane import clips_in_sight
from ui.panels.timeline.rows.columns import group_size, largest_of_groups, provisional_text
from ui.panels.timeline.rows.rows import SEAMS
from ui.panels.timeline.rows.stage import TimelineStage, small_text
from ui.style import theme
from ui.style.colors import Color, rgb

LOWEST, HIGHEST = SEAM_RATIO_RANGE
FIRST_COLOR = 84
"""Of the colour map: what lies before is as dark as the track."""
MARK_WIDTH = 7.0
MIN_TEXT_ROOM = 36.0
"""A ratio is written unless the next mark is nearer than this."""
MIN_MARK_DISTANCE = 9.0
"""Seams closer together than this are shown as one, the worst of them."""
REACH = 6.0
"""How far from a mark a click still counts, units."""


def seam_color(ratio: float) -> Color:
    """Colour of a ratio, held inside the scale."""
    share = min(max((ratio - LOWEST) / (HIGHEST - LOWEST), 0.0), 1.0)
    return _color_of_row(FIRST_COLOR + round(share * (N_COLORS - 1 - FIRST_COLOR)))


@lru_cache
def _color_of_row(row: int) -> Color:
    red, green, blue = COLOR_MAPS["inferno"][row].tolist()
    return rgb(red, green, blue)


def ratio_text(ratio: float) -> str:
    """A ratio as it is written; one that is flagged carries a sign."""
    return f"{ratio:.1f}!" if ratio > SEAM_RATIO_FLAGGED else f"{ratio:.1f}"


def seams_in_sight(stage: TimelineStage, session: SessionView) -> list[tuple[int, float]]:
    """Clip behind the seam and ratio (NaN where not all of it is measured) of every mark, from left to right."""
    first, stop = clips_in_sight(session, stage.scale)
    n_clips = min(len(session.clips), len(session.clip_states))
    first = max(first, 1)
    if first >= stop:
        return []
    size = group_size(session.timeline.spans.usual_length * stage.scale.per_frame, MIN_MARK_DISTANCE)
    first -= (first - 1) % size
    ratios = stage.ui.timeline.ratios(session.residual_status.seams, n_clips)[first:stop]
    if size == 1:
        return list(zip(range(first, stop), ratios.tolist(), strict=True))
    largest = largest_of_groups(ratios, size)
    padded = np.full(len(largest) * size, -np.inf, np.float32)
    padded[: len(ratios)] = np.where(np.isnan(ratios), -np.inf, ratios)
    worst = padded.reshape(-1, size).argmax(axis=1) + np.arange(0, len(padded), size)
    return list(zip((first + worst).tolist(), largest.tolist(), strict=True))


def draw_seam_lane(stage: TimelineStage, session: SessionView) -> None:
    """The marks in sight, and a note on the one under the pointer."""
    row = stage.rows[SEAMS]
    marks = seams_in_sight(stage, session)
    for place, (clip_index, ratio) in enumerate(marks):
        x = stage.scale.left_of(session.clips[clip_index].start)
        if not stage.scale.x0 <= x <= stage.scale.x1:
            continue
        after = marks[place + 1][0] if place + 1 < len(marks) else None
        room = stage.scale.x1 - x if after is None else stage.scale.left_of(session.clips[after].start) - x
        mark = Rect(x - MARK_WIDTH / 2, row.y0 + 1, x + MARK_WIDTH / 2, row.y1 - 1)
        stage.ui.mark_rect(f"timeline.seam{clip_index}", mark)
        text = _provisional(session, clip_index).partition(" ")[0] if np.isnan(ratio) else ratio_text(ratio)
        _draw_mark(stage, mark, ratio, text, room)
    pointed = seam_at(stage, session)
    if pointed is not None:
        _draw_note(session, *pointed)


def _provisional(session: SessionView, clip_index: int) -> str:
    seams = session.residual_status.seams[clip_index - 1 : clip_index]
    return "".join(provisional_text(seam) for seam in seams if seam.clip_index == clip_index)


def _draw_mark(stage: TimelineStage, mark: Rect, ratio: float, text: str, room: float) -> None:
    draw = stage.draw
    if np.isnan(ratio):
        top = mark.y1 - mark.height / 2
        draw.add_rect(ImVec2(mark.x0, top), mark.high, theme.u32(theme.faded(theme.TEXT_DIM, 0.7)))
    else:
        share = min(max((ratio - LOWEST) / (HIGHEST - LOWEST), 0.0), 1.0)
        top = mark.y1 - mark.height * (0.3 + 0.7 * share)
        draw.add_rect_filled(ImVec2(mark.x0, top), mark.high, theme.u32(seam_color(ratio)), 1)
    if room < MIN_TEXT_ROOM:
        text = ""
    if not text and ratio > SEAM_RATIO_FLAGGED and room >= MARK_WIDTH + 6:
        text = "!"
    if text:
        color = theme.TEXT if ratio > SEAM_RATIO_FLAGGED else theme.TEXT_DIM
        small_text(draw, mark.x1 + 3, mark.y0 + 1, text, color)


def seam_at(stage: TimelineStage, session: SessionView) -> tuple[int, float] | None:
    """The mark under the pointer: the clip behind it and its ratio."""
    if not stage.is_pointed_at(SEAMS) or stage.pointer is None:
        return None
    distances = [
        (abs(stage.scale.left_of(session.clips[clip_index].start) - stage.pointer[0]), clip_index, ratio)
        for clip_index, ratio in seams_in_sight(stage, session)
    ]
    distance, clip_index, ratio = min(distances, default=(np.inf, 0, np.nan))
    return (clip_index, ratio) if distance <= REACH else None


def _draw_note(session: SessionView, clip_index: int, ratio: float) -> None:
    words = f"Seam between clips {clip_index - 1} and {clip_index}, at frame {session.clips[clip_index].start}"
    text = _provisional(session, clip_index) if np.isnan(ratio) else ratio_text(ratio)
    if text:
        words += f"\nChange at the seam relative to inside the clips: {text}"
        words += f"\n1 means no seam; above {SEAM_RATIO_FLAGGED:g} is worth a look"
    else:
        words += "\nNot measured"
    imgui.begin_tooltip()
    imgui.text_unformatted(f"{words}\nClick to play around it (/)")
    imgui.end_tooltip()
