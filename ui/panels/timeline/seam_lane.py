"""The lane of seams: one mark per boundary between clips, on a fixed scale of 1 to 3. A click plays around it.

Height and colour say the same, from dark violet to light yellow; above FLAGGED a sign is added. Where a boundary was
not measured, only its outline is drawn.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from imgui_bundle import ImVec2, imgui

from ui.panels.state import Rect
from ui.panels.timeline.clip_lane import clips_in_sight
from ui.panels.timeline.columns import group_size, largest_of_groups
from ui.panels.timeline.needs import TimelineNeeds
from ui.panels.timeline.rows import SEAMS
from ui.panels.timeline.stage import Stage, small_text
from ui.style import theme
from ui.style.colors import Color, rgb

LOWEST, HIGHEST = 1.0, 3.0
"""Ends of the scale, which is the same for every capture and at every time."""
FLAGGED = 2.0
COLORS = (rgb(116, 62, 160), rgb(190, 55, 110), rgb(237, 105, 37), rgb(251, 180, 26), rgb(252, 255, 164))
"""From LOWEST to HIGHEST in equal steps: lightness rises throughout."""
N_STEPS = 100
MARK_WIDTH = 7.0
MIN_TEXT_ROOM = 36.0
"""A score is written where the next mark is no nearer than this."""
MIN_MARK_DISTANCE = 9.0
"""Seams closer together than this are shown as one, the worst of them."""
REACH = 6.0
"""How far from a mark a click still counts, units."""


def seam_color(score: float) -> Color:
    """Colour of a score, held inside the scale."""
    share = min(max((score - LOWEST) / (HIGHEST - LOWEST), 0.0), 1.0)
    return _color_of_step(round(share * N_STEPS))


@lru_cache
def _color_of_step(step: int) -> Color:
    place = step / N_STEPS * (len(COLORS) - 1)
    low = min(int(place), len(COLORS) - 2)
    weight = place - low
    red, green, blue, alpha = ((1 - weight) * a + weight * b for a, b in zip(COLORS[low], COLORS[low + 1], strict=True))
    return red, green, blue, alpha


def score_text(score: float) -> str:
    """A score as it is written; one that is flagged carries a sign."""
    return f"{score:.1f}!" if score > FLAGGED else f"{score:.1f}"


def seams_in_sight(stage: Stage, session: TimelineNeeds) -> list[tuple[int, float]]:
    """Clip behind the seam and score (NaN where not measured) of every mark, from left to right."""
    first, stop = clips_in_sight(session, stage.scale)
    n_clips = min(len(session.clips), len(session.clip_states))
    first = max(first, 1)
    if first >= stop:
        return []
    size = group_size(session.clips[0].clip_length * stage.scale.per_frame, MIN_MARK_DISTANCE)
    first -= (first - 1) % size
    scores = stage.ui.timeline.scores(session.seams, n_clips)[first:stop]
    if size == 1:
        return list(zip(range(first, stop), scores.tolist(), strict=True))
    largest = largest_of_groups(scores, size)
    padded = np.full(len(largest) * size, -np.inf, np.float32)
    padded[: len(scores)] = np.where(np.isnan(scores), -np.inf, scores)
    worst = padded.reshape(-1, size).argmax(axis=1) + np.arange(0, len(padded), size)
    return list(zip((first + worst).tolist(), largest.tolist(), strict=True))


def draw_seam_lane(stage: Stage, session: TimelineNeeds) -> None:
    """The marks in sight, and what is known of the one under the pointer."""
    row = stage.rows[SEAMS]
    marks = seams_in_sight(stage, session)
    for place, (clip_index, score) in enumerate(marks):
        x = stage.scale.left_of(session.clips[clip_index].start)
        if not stage.scale.x0 <= x <= stage.scale.x1:
            continue
        after = marks[place + 1][0] if place + 1 < len(marks) else None
        room = stage.scale.x1 - x if after is None else stage.scale.left_of(session.clips[after].start) - x
        mark = Rect(x - MARK_WIDTH / 2, row.y0 + 1, x + MARK_WIDTH / 2, row.y1 - 1)
        stage.ui.mark_rect(f"timeline.seam{clip_index}", mark)
        _draw_mark(stage, mark, score, room)
    pointed = seam_at(stage, session)
    if pointed is not None:
        _draw_note(session, *pointed)


def _draw_mark(stage: Stage, mark: Rect, score: float, room: float) -> None:
    draw = stage.draw
    if np.isnan(score):
        top = mark.y1 - mark.height / 2
        draw.add_rect(ImVec2(mark.x0, top), mark.high, theme.u32(theme.faded(theme.TEXT_DIM, 0.7)))
        return
    share = min(max((score - LOWEST) / (HIGHEST - LOWEST), 0.0), 1.0)
    top = mark.y1 - mark.height * (0.3 + 0.7 * share)
    draw.add_rect_filled(ImVec2(mark.x0, top), mark.high, theme.u32(seam_color(score)), 1)
    text = score_text(score) if room >= MIN_TEXT_ROOM else ""
    if not text and score > FLAGGED and room >= MARK_WIDTH + 6:
        text = "!"
    if text:
        color = theme.TEXT if score > FLAGGED else theme.TEXT_DIM
        small_text(draw, mark.x1 + 3, mark.y0 + 1, text, color)


def seam_at(stage: Stage, session: TimelineNeeds) -> tuple[int, float] | None:
    """The mark under the pointer: the clip behind it and its score."""
    if not stage.is_pointed_at(SEAMS) or stage.pointer is None:
        return None
    distances = [
        (abs(stage.scale.left_of(session.clips[clip_index].start) - stage.pointer[0]), clip_index, score)
        for clip_index, score in seams_in_sight(stage, session)
    ]
    distance, clip_index, score = min(distances, default=(np.inf, 0, np.nan))
    return (clip_index, score) if distance <= REACH else None


def _draw_note(session: TimelineNeeds, clip_index: int, score: float) -> None:
    words = f"Seam between clips {clip_index - 1} and {clip_index}, at frame {session.clips[clip_index].start}"
    if np.isnan(score):
        words += "\nNot measured"
    else:
        words += f"\nScore {score_text(score)} on a scale of 1 (nothing to be seen) to 3; above 2 is worth a look"
    imgui.begin_tooltip()
    imgui.text_unformatted(f"{words}\nClick to play around it (/)")
    imgui.end_tooltip()
