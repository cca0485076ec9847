"""The lane of clips: one band per clip with its state and progress; runs of one state where clips are too narrow."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.psnr_words import psnr_label
from app.session.session_view import SessionView
from app.status import ClipStatus
from engine.capture.clip import Clip
from ui.panels.editing.labels import with_label
from ui.panels.state import Rect
from ui.panels.timeline.clip_words import clip_title, state_note, state_words
from ui.panels.timeline.rows.columns import MIN_GROUP_WIDTH, STATES, group_size, largest_of_groups, runs_of
from ui.panels.timeline.rows.rows import CLIPS
from ui.panels.timeline.rows.stage import TimelineStage, hatch
from ui.panels.timeline.time_range import TimeScale
from ui.style import theme
from ui.style.progress_words import band_words, running_words

MIN_BAND_WIDTH = 14.0
"""Clips narrower than this are drawn in runs of one state."""
MIN_WORDS_WIDTH = 60.0
MIN_HATCH_WIDTH = 5.0
NOTE_WIDTH = 380.0
WARNED = ("failed", "stale", "damaged", "stopped")
GOING = ("preparing", "training", "paused", "stopped")


def clips_in_sight(session: SessionView, scale: TimeScale) -> tuple[int, int]:
    """The first clip of which something is shown, and one past the last."""
    n_clips = min(len(session.clips), len(session.clip_states))
    if n_clips == 0:
        return 0, 0
    spans = session.timeline.spans
    first = min(spans.index_of(int(scale.shown.start)), n_clips - 1)
    return first, min(max(spans.index_of(int(scale.shown.stop) - 1), first) + 2, n_clips)


def draw_clip_lane(stage: TimelineStage, session: SessionView) -> None:
    """Bands or runs in sight, and the note of the clip under the pointer."""
    first, stop = clips_in_sight(session, stage.scale)
    if first == stop:
        return
    clip_width = session.timeline.spans.usual_length * stage.scale.per_frame
    if clip_width >= MIN_BAND_WIDTH:
        for index in range(first, stop):
            band = _band(stage, session, index, index)
            stage.ui.mark_rect(f"timeline.clip{index}", band)
            _draw_band(stage.draw, band, session, session.clips[index], session.clip_states[index])
    else:
        _draw_runs(stage, session, (first, stop))
    if stage.is_pointed_at(CLIPS) and stage.pointer is not None:
        _draw_note(session, stage.scale.frame_at(stage.pointer[0]))


def _draw_runs(stage: TimelineStage, session: SessionView, in_sight: tuple[int, int]) -> None:
    """Runs of one state. There may be hundreds of them, hardly wider than a line: those are drawn with one call."""
    row, scale, draw, rects = stage.rows[CLIPS], stage.scale, stage.draw, stage.ui.rects
    y0, y1 = row.y0, row.y1
    packed = {state: theme.u32(theme.faded(theme.status_color(state), 0.62)) for state in STATES}
    clips, x_of_start, per_frame = session.clips, scale.left_of(0.0), scale.per_frame
    for begin, last, state in state_runs(session, stage, in_sight, MIN_GROUP_WIDTH):
        x0, x1 = x_of_start + clips[begin].start * per_frame, x_of_start + clips[last].stop * per_frame
        if x1 - x0 < MIN_HATCH_WIDTH:
            draw.add_rect_filled(ImVec2(x0, y0), ImVec2(x1, y1), packed[state])
            rects[f"timeline.clip{begin}"] = Rect(x0, y0, x1, y1)
        else:
            band = _band(stage, session, begin, last)
            rects[f"timeline.clip{begin}"] = band
            _draw_run(draw, band, begin, last, state, state_words(state, session))


def state_runs(
    session: SessionView, stage: TimelineStage, in_sight: tuple[int, int], smallest: float
) -> list[tuple[int, int, str]]:
    """First clip, last clip and state of every run. Clips that are narrower than `smallest` count together, as the one
    among them that matters most."""
    first, stop = in_sight
    size = group_size(session.timeline.spans.usual_length * stage.scale.per_frame, smallest)
    first -= first % size  # the same clips together wherever the view is moved to
    codes = largest_of_groups(stage.ui.timeline.columns(session.clip_states).states[first:stop], size)
    return [
        (first + begin * size, min(first + (last + 1) * size, stop) - 1, STATES[codes[begin]])
        for begin, last in runs_of(codes)
    ]


def _band(stage: TimelineStage, session: SessionView, first: int, last: int) -> Rect:
    """The visible part of a band, so that its words are visible, too."""
    row, scale = stage.rows[CLIPS], stage.scale
    x0 = max(scale.left_of(session.clips[first].start) + 1, scale.x0)
    x1 = min(scale.left_of(session.clips[last].stop) - 1, scale.x1)
    return Rect(x0, row.y0, max(x1, x0 + 1), row.y1)


def _draw_run(draw: imgui.ImDrawList, band: Rect, first: int, last: int, state: str, words: str) -> None:
    """Many clips in one state as one band. words: Of the state."""
    color = theme.status_color(state)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.RAISED), 3)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.38 if state == "trained" else 0.22)), 3)
    if state in WARNED:
        hatch(draw, band, theme.faded(color, 0.55), 7.0, is_crossed=state == "damaged")
    draw.add_rect_filled(ImVec2(band.x0, band.y1 - 3), band.high, theme.u32(color), 2)
    if band.width < MIN_WORDS_WIDTH:
        return
    icon = theme.CLIP_ICONS.get(state, "")
    title = f"Clips {first} to {last}" if last > first else f"Clip {first}"
    words = f"{icon}  {words}".strip()
    title = next((text for text in (title, f"{first}-{last}") if _fits(text, band)), "")  # a part would mislead
    _draw_lines(draw, band, title, words if _fits(words, band) else icon, theme.TEXT)


def _draw_band(draw: imgui.ImDrawList, band: Rect, session: SessionView, clip: Clip, status: ClipStatus) -> None:
    state, color = status.state, theme.status_color(status.state)
    draw.add_rect_filled(band.low, band.high, theme.u32(theme.RAISED), 3)
    if state == "trained":
        draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.38)), 3)
    elif state in GOING:
        share = min(max(float(status.progress), 0.0), 1.0)
        filled = ImVec2(band.x0 + band.width * share, band.y1)
        draw.add_rect_filled(band.low, filled, theme.u32(theme.faded(color, 0.38)), 3)
        hatch(draw, Rect(filled.x, band.y0, band.x1, band.y1), theme.faded(color, 0.16), 10.0)
    elif state in WARNED:
        draw.add_rect_filled(band.low, band.high, theme.u32(theme.faded(color, 0.22)), 3)
        hatch(draw, band, theme.faded(color, 0.55), 7.0, is_crossed=state == "damaged")
    elif state == "queued":
        hatch(draw, band, theme.faded(color, 0.28), 14.0)
    draw.add_rect_filled(ImVec2(band.x0, band.y1 - 3), band.high, theme.u32(color), 2)
    _draw_words(draw, band, session, clip, status)


def _draw_words(draw: imgui.ImDrawList, band: Rect, session: SessionView, clip: Clip, status: ClipStatus) -> None:
    state = status.state
    icon = theme.CLIP_ICONS.get(state, "")
    if band.width < MIN_WORDS_WIDTH:
        text = icon or str(clip.clip_index)
        if imgui.calc_text_size(text).x + 4 <= band.width:
            draw.add_text(ImVec2(band.x0 + 3, band.y0 + 4), theme.u32(theme.TEXT), text)
        return
    plain = clip_title(clip.clip_index, session.reference_index)
    titles = (with_label(session, "clip", str(clip.start), plain), plain, str(clip.clip_index))
    words = band_words(status, session.training, clip.clip_index, state_words(state, session))
    if status.held_out_psnr is not None:
        words = f"{words}, {psnr_label(status.held_out_psnr, is_whole=status.held_out_whole)} dB"
    title = next((title for title in titles if _fits(title, band)), titles[-1])
    line_two = f"{icon}  {words}" if icon else words
    if not _fits(line_two, band):
        line_two = icon or ""
    _draw_lines(draw, band, title, line_two, theme.TEXT if state != "untrained" else theme.TEXT_DIM)


def _fits(text: str, band: Rect) -> bool:
    return imgui.calc_text_size(text).x + 18 <= band.width


def _draw_lines(draw: imgui.ImDrawList, band: Rect, title: str, words: str, color: theme.Color) -> None:
    """Title and words: one under the other where there is room for two lines, else side by side."""
    x = band.x0 + 9
    if band.height > 40:
        y = band.y0 + (band.height - 38) / 2
        draw.add_text(ImVec2(x, y), theme.u32(theme.TEXT), title)
        draw.add_text(ImVec2(x, y + 18), theme.u32(color), words)
        return
    y = band.y0 + (band.height - 19) / 2
    draw.add_text(ImVec2(x, y), theme.u32(theme.TEXT), title)
    beside = x + imgui.calc_text_size(title).x + 14
    if beside + imgui.calc_text_size(words).x < band.x1:
        draw.add_text(ImVec2(beside, y), theme.u32(color), words)


def _draw_note(session: SessionView, frame_index: int) -> None:
    """The reason of a clip's state, or where and how fast it trains, where the pointer is over its band."""
    clip = session.timeline.clip_of(frame_index)
    status = None if clip is None else session.clip_states[clip.clip_index]
    running = None if clip is None else session.training.of_clip(clip.clip_index)
    note = "" if status is None else state_note(status) if running is None else running_words(running)
    if clip is None or status is None or not (note or session.edits.label("clip", str(clip.start))):
        return
    imgui.begin_tooltip()
    imgui.push_text_wrap_pos(NOTE_WIDTH)
    title = with_label(session, "clip", str(clip.start), clip_title(clip.clip_index, session.reference_index))
    imgui.text_unformatted(f"{title}: {state_words(status.state, session)}. {note}")
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()
