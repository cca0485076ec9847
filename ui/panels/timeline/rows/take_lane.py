"""The lane of the take: each segment over the frames of the capture that it plays, with its place in the order. A click
chooses it.
"""

from __future__ import annotations

from functools import lru_cache

from imgui_bundle import imgui

from app.document.changes.timing_changes import segment_words
from app.session.session_view import SessionView
from engine.timing.segment import Segment
from ui.panels.state import Rect
from ui.panels.timeline.rows.rows import TAKE
from ui.panels.timeline.rows.stage import SMALL_TEXT, TimelineStage, small_text, small_width
from ui.style import theme
from ui.style.theme import Icon

MAX_LEVELS = 3
"""Segments that play the same frames lie in so many levels; more of them cover each other."""


@lru_cache(maxsize=4)
def levels_of(segments: tuple[Segment, ...]) -> tuple[int, ...]:
    """The level of each segment: those that play the same frames lie below each other as far as there is room. Asked
    for in every frame of the window."""
    levels: list[list[Segment]] = [[] for _ in range(MAX_LEVELS - 1)]
    found: list[int] = []
    for one in segments:
        is_free = (all(other.stop <= one.first or one.stop <= other.first for other in level) for level in levels)
        level = next((level for level, free in enumerate(is_free) if free), MAX_LEVELS - 1)
        found.append(level)
        if level < len(levels):
            levels[level].append(one)
    return tuple(found)


def draw_take_lane(stage: TimelineStage, session: SessionView) -> None:
    """A block per segment, with its number and what is special about it."""
    segments, view = session.edits.timing, stage.ui.timeline
    pointed = segment_at(stage, session)
    for place, block in enumerate(_blocks(stage, segments)):
        one, is_chosen = segments[place], view.segment == place
        color = theme.YELLOW if is_chosen else theme.PURPLE
        stage.draw.add_rect_filled(block.low, block.high, theme.u32(theme.faded(color, 0.45)), 3)
        stage.draw.add_rect(block.low, block.high, theme.u32(color), 3, thickness=1.5 if place == pointed else 1.0)
        text = f"{place}  {_marks(one)}".rstrip()
        if block.height >= SMALL_TEXT - 2 and small_width(text) < block.width - 6:
            small_text(stage.draw, block.x0 + 4, (block.y0 + block.y1 - SMALL_TEXT) / 2 - 1, text, theme.TEXT)
        stage.ui.mark_rect(f"timeline.segment{place}", block)
    if pointed is not None:
        imgui.begin_tooltip()
        imgui.text_unformatted(f"Segment {pointed}: {segment_words(segments[pointed])}")
        imgui.end_tooltip()


def _marks(one: Segment) -> str:
    if one.n_frozen:
        return f"{Icon.PAUSE} {one.n_frozen}"
    speeds = f"{one.speed_at(0.0):.3g}x"
    if one.start_speed != one.end_speed:
        speeds = f"{speeds} – {one.speed_at(1.0):.3g}x"
    words = ["<" if one.is_reversed else "", "" if speeds == "1x" else speeds]
    words.append(f"{Icon.LOOP} {one.repeats}" if one.repeats > 1 else "")
    return "  ".join(word for word in words if word)


def _blocks(stage: TimelineStage, segments: tuple[Segment, ...]) -> list[Rect]:
    row, scale = stage.rows[TAKE], stage.scale
    levels = levels_of(segments)
    height = row.height / (max(levels, default=0) + 1)
    found: list[Rect] = []
    for one, level in zip(segments, levels, strict=True):
        x0, x1 = (scale.x0 + (frame - scale.shown.start) * scale.per_frame for frame in (one.first, one.stop))
        y0 = row.y0 + level * height
        found.append(Rect(x0 + 0.5, y0, max(x1 - 0.5, x0 + 2.0), y0 + height - 1.0))
    return found


def segment_at(stage: TimelineStage, session: SessionView) -> int | None:
    """Number of the segment under the pointer; where they cover each other, of the last one."""
    segments = session.edits.timing
    if not segments or stage.pointer is None or not stage.is_pointed_at(TAKE):
        return None
    found = [place for place, block in enumerate(_blocks(stage, segments)) if block.contains(*stage.pointer)]
    return found[-1] if found else None
