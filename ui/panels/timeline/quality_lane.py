"""The lane of quality: held-out PSNR of each clip as steps, on a fixed scale, so that captures can be compared."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from ui.panels.timeline.clip_lane import clips_in_sight
from ui.panels.timeline.columns import MIN_GROUP_WIDTH, group_size, runs_of
from ui.panels.timeline.needs import TimelineNeeds
from ui.panels.timeline.rows import QUALITY
from ui.panels.timeline.stage import Stage
from ui.style import theme

LOWEST_DB, HIGHEST_DB = 20.0, 40.0
MIDDLE_DB = 30.0


def draw_quality_lane(stage: Stage, session: TimelineNeeds) -> None:
    """One step per clip in sight, and the figure under the pointer."""
    row, scale, draw = stage.rows[QUALITY], stage.scale, stage.draw
    draw.add_line_h(scale.x0, scale.x1, _height(stage, MIDDLE_DB), theme.u32(theme.faded(theme.TEXT, 0.12)))
    first, stop = clips_in_sight(session, scale)
    if first == stop:
        return
    size = group_size(session.clips[0].clip_length * scale.per_frame, MIN_GROUP_WIDTH)
    first -= first % size
    psnr = stage.ui.timeline.columns(session.clip_states).psnr[first:stop]
    means = psnr if size == 1 else _means(psnr, size)
    heights = np.round(2 * (row.y1 - 2 - (row.height - 4) * _shares(means))) / 2  # equal where they look the same
    color = theme.u32(theme.GREEN)
    end = (-2, 0.0)
    edges = scale.left_of(session.clips[first].start) + np.arange(len(heights) + 1) * (
        size * session.clips[0].clip_length * scale.per_frame
    )
    lefts = np.clip(edges, scale.x0, min(scale.x1, scale.left_of(scale.n_frames))).tolist()
    levels = heights.tolist()
    for begin, last in runs_of(heights):
        y, x0, x1 = levels[begin], lefts[begin], lefts[last + 1]
        if y != y:  # not measured
            continue
        if end[0] == begin - 1:
            draw.add_line_v(x0, min(end[1], y), max(end[1], y), color, 1.5)
        draw.add_line_h(x0, x1, y, color, 2)
        end = (last, y)
    if stage.is_pointed_at(QUALITY) and stage.pointer is not None:
        _draw_note(session, scale.frame_at(stage.pointer[0]))


def _means(psnr: np.ndarray, size: int) -> np.ndarray:
    """Mean of each run of `size` neighbours that were measured; NaN where none was. [ceil(n / size)]"""
    is_known = np.isfinite(psnr)
    places = np.arange(0, len(psnr), size)
    sums = np.add.reduceat(np.where(is_known, psnr, 0.0), places)
    counts = np.add.reduceat(is_known.astype(np.float32), places)
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan)


def _shares(decibels: np.ndarray | np.float64) -> np.ndarray:
    """Places on the scale, 0 to 1."""
    return np.clip((decibels - LOWEST_DB) / (HIGHEST_DB - LOWEST_DB), 0.0, 1.0)


def _height(stage: Stage, decibels: float) -> float:
    row = stage.rows[QUALITY]
    return row.y1 - 2 - (row.height - 4) * float(_shares(np.float64(decibels)))


def _draw_note(session: TimelineNeeds, frame_index: int) -> None:
    clip = session.timeline.clip_of(frame_index)
    if clip is None:
        return
    psnr = session.clip_states[clip.clip_index].held_out_psnr
    words = "not measured" if psnr is None else f"{psnr:.2f} dB on held-out cameras"
    imgui.begin_tooltip()
    imgui.text_unformatted(
        f"Clip {clip.clip_index}: {words}\nThe scale goes from {LOWEST_DB:g} to {HIGHEST_DB:g} dB, the line is at "
        f"{MIDDLE_DB:g}"
    )
    imgui.end_tooltip()
