"""The lane of quality: held-out PSNR of each clip as steps, and of each measured frame, on a fixed scale."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from imgui_bundle import imgui

from app.psnr_words import psnr_words
from app.session.session_view import SessionView
from ui.panels.timeline.rows.clip_lane import clips_in_sight
from ui.panels.timeline.rows.columns import MIN_GROUP_WIDTH, group_size, means_of_groups, runs_of
from ui.panels.timeline.rows.rows import QUALITY
from ui.panels.timeline.rows.stage import TimelineStage
from ui.style import theme

LOWEST_DB, HIGHEST_DB = 20.0, 40.0
MIDDLE_DB = 30.0
MIN_FRAME_GROUP_WIDTH = 4.0
"""Frames narrower than this count together, units of the screen."""


def draw_quality_lane(stage: TimelineStage, session: SessionView) -> None:
    """The steps in sight, and the figures under the pointer."""
    scale = stage.scale
    stage.draw.add_line_h(scale.x0, scale.x1, _height(stage, MIDDLE_DB), theme.u32(theme.faded(theme.TEXT, 0.12)))
    frames = stage.ui.timeline.frame_psnr(session.residual_status)
    first, stop = clips_in_sight(session, scale)
    if first == stop:
        return
    if len(frames) == scale.n_frames:
        in_sight = math.floor(scale.shown.start), math.ceil(scale.shown.stop)
        _draw_steps(stage, frames, in_sight, lambda places: places, 1, MIN_FRAME_GROUP_WIDTH, theme.SKY, 1.0)
    clips = stage.ui.timeline.columns(session.clip_states).psnr
    length = session.timeline.spans.usual_length
    _draw_steps(stage, clips, (first, stop), partial(_starts, session), length, MIN_GROUP_WIDTH, theme.GREEN, 2.0)
    if stage.is_pointed_at(QUALITY) and stage.pointer is not None:
        _draw_note(session, scale.frame_at(stage.pointer[0]), frames)


def _starts(session: SessionView, places: np.ndarray) -> np.ndarray:
    """First frames of clips; of one past the last clip the number of frames."""
    clips = session.clips
    return np.array([clips[place].start if place < len(clips) else clips[-1].stop for place in places.tolist()])


def _draw_steps(
    stage: TimelineStage,
    values: np.ndarray,
    in_sight: tuple[int, int],
    starts_of: Callable[[np.ndarray], np.ndarray],
    n_frames: int,
    smallest: float,
    color: theme.Color,
    thickness: float,
) -> None:
    """A line of steps, one per value; values that lie too close for that, or look the same, together.

    Args:
        values: dB; NaN leaves a gap. [n]
        in_sight: The first value to draw, and one past the last.
        starts_of: The frame that each of these values begins with; one past the last value counts, too.
        n_frames: That a value is of usually.
        smallest: Width of a step, units of the screen.
    """
    row, scale, draw = stage.rows[QUALITY], stage.scale, stage.draw
    size = group_size(n_frames * scale.per_frame, smallest)
    first = in_sight[0] - in_sight[0] % size
    means = means_of_groups(values[first : in_sight[1]], size)
    levels = np.round(2 * (row.y1 - 2 - (row.height - 4) * _shares(means))) / 2  # to half a unit
    places = np.minimum(first + np.arange(len(levels) + 1) * size, len(values))
    edges = scale.left_of(0.0) + starts_of(places) * scale.per_frame
    xs = np.clip(edges, scale.x0, min(scale.x1, scale.left_of(scale.n_frames))).tolist()
    ys = levels.tolist()
    packed = theme.u32(color)
    end = -1
    for begin, last in runs_of(levels):
        y = ys[begin]
        if math.isnan(y):
            continue
        if begin and end == begin - 1:
            draw.add_line_v(xs[begin], min(ys[end], y), max(ys[end], y), packed, thickness)
        draw.add_line_h(xs[begin], xs[last + 1], y, packed, thickness)
        end = last


def _shares(decibels: np.ndarray | float) -> np.ndarray:
    """Places on the scale, 0 to 1."""
    return np.clip((np.asarray(decibels) - LOWEST_DB) / (HIGHEST_DB - LOWEST_DB), 0.0, 1.0)


def _height(stage: TimelineStage, decibels: float) -> float:
    row = stage.rows[QUALITY]
    return row.y1 - 2 - (row.height - 4) * float(_shares(decibels))


def _draw_note(session: SessionView, frame_index: int, frames: np.ndarray) -> None:
    clip = session.timeline.clip_of(frame_index)
    if clip is None:
        return
    status = session.clip_states[clip.clip_index]
    psnr = status.held_out_psnr
    imgui.begin_tooltip()
    words = "not measured" if psnr is None else psnr_words(psnr, is_whole=status.held_out_whole)
    imgui.text_unformatted(f"Clip {clip.clip_index}: {words}")
    if frame_index < len(frames) and np.isfinite(frames[frame_index]):
        imgui.text_unformatted(f"Frame {frame_index}: {frames[frame_index]:.2f} dB")
    imgui.text_disabled(f"From {LOWEST_DB:g} to {HIGHEST_DB:g} dB; the line is at {MIDDLE_DB:g}")
    imgui.end_tooltip()
