"""The queue in the training panel: what waits and how long all of it takes, what failed, and how training is shown.

A row is moved by its arrows, by dragging, or by keys once it is chosen; see ui.panels.actions.clips.training.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.session_view import SessionView
from app.session.training.train_commands import (
    MoveInQueue,
    RemoveFromQueue,
    SetLiveView,
    StopAfterClip,
    TrainAll,
    TrainClip,
)
from app.status import QueueStatus, SequenceForecast, UsageStatus
from engine.text import duration_text, size_text
from ui.panels.pieces.widgets import elided, text_right, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.theme import Icon

MAX_ROWS = 6
ROW_HEIGHT = 26.0
BUTTON_WIDTH = 24.0
PAYLOAD = "queued clip"
LIVE_WORDS = {
    "off": ("Off", "Show no intermediate results"),
    "low": ("Low", "Refresh every 10 s"),
    "live": ("Live", "Refresh every 2 s"),
}


# ---- words -----------------------------------------------------------------------------------------------------


def clips_text(n: int) -> str:
    """A number of clips."""
    return "1 clip" if n == 1 else f"{format_count(n)} clips"


def forecast_text(forecast: SequenceForecast) -> str:
    """Clips, steps, time and disk in one line, as far as they are known."""
    parts = [clips_text(forecast.n_clips)]
    if forecast.n_steps:
        parts.append(f"{format_count(forecast.n_steps)} steps")
    if forecast.seconds is not None:
        parts.append(f"about {duration_text(forecast.seconds)}")
    if forecast.disk_mb is not None:
        parts.append(f"{size_text(forecast.disk_mb)} on disk")
    return ", ".join(parts)


def room_text(queue: QueueStatus) -> str:
    """That the disk is too small, where it is known to be; empty otherwise."""
    needed = None if queue.everything is None else queue.everything.disk_mb
    if needed is None or queue.free_mb is None or needed <= queue.free_mb:
        return ""
    return f"Only {size_text(queue.free_mb)} are free on the disk."


def usage_text(usage: UsageStatus) -> str:
    """Memory and processor of all processes together; empty where the system does not say."""
    memory = [value for value in (usage.window_mb, usage.training_mb) if value is not None]
    cores = [value for value in (usage.window_cores, usage.training_cores) if value is not None]
    parts = [size_text(sum(memory))] if memory else []
    if cores and usage.training_cores is not None:
        parts.append(f"{sum(cores):.1f} of {usage.n_cores} cores")
    return ", ".join(parts)


# ---- parts of the panel ----------------------------------------------------------------------------------------


def draw_train_all(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The button that trains everything that is left, and the cost; nothing where at most one clip is."""
    queue = session.queue
    everything, queued = queue.everything, queue.queued
    n_queued = 0 if queued is None else queued.n_clips
    if everything is None or everything.n_clips < 2:
        return
    if everything.n_clips > n_queued:
        imgui.begin_disabled(session.training.state == "stopping")
        if imgui.button(f"{Icon.LAYERS}  Train all {clips_text(everything.n_clips)}", ImVec2(-1, 32)):
            dispatch(TrainAll())
        ui.mark("training.all")
        imgui.end_disabled()
        imgui.set_item_tooltip("Shift+T")
        text_wrapped_dim(f"All: {forecast_text(everything)}.")
        ui.mark("training.forecast")
    room = room_text(queue)
    if room:
        imgui.push_text_wrap_pos(0.0)
        imgui.text_colored(ImVec4(*theme.ORANGE), f"{Icon.WARNING}  {room}")
        imgui.pop_text_wrap_pos()


def draw_queue(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Progress of the whole sequence, the clips that wait, and those that failed."""
    queue, queued = session.queue, session.queue.queued
    if queued is not None and (queued.n_clips > 1 or queue.n_done or queue.waiting):
        left = "" if queued.seconds is None else f", about {duration_text(queued.seconds)}"
        words = "held" if queue.is_held else "left"
        imgui.set_next_item_open(True, imgui.Cond_.once)
        is_open = imgui.collapsing_header(f"Queue: {clips_text(queued.n_clips)} {words}{left}###queue")
        ui.mark("queue.header")
        if is_open:
            _draw_whole(session, dispatch, ui)
            _draw_rows(queue, dispatch, ui)
    for clip_index, reason in queue.failed:
        _draw_failed(clip_index, reason, dispatch, ui)


def _draw_whole(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    queue = session.queue
    imgui.progress_bar(min(max(queue.progress, 0.0), 1.0), ImVec2(-1, 6), "")
    ui.mark("queue.progress")
    queued = queue.queued
    if queued is not None and queued.n_steps:
        n_all = queue.n_done + queued.n_clips
        text_wrapped_dim(f"{queue.n_done} of {n_all} done, {format_count(queued.n_steps)} steps left")
    if session.training.state not in ("idle", "failed") and queue.waiting:
        which = "this clip" if session.training.n_running < 2 else "the next finished clip"
        is_toggled, is_wanted = imgui.checkbox(f"Hold after {which}###hold", queue.is_ending_after)
        ui.mark("queue.stop_after")
        imgui.set_item_tooltip(f"No clip begins after {which}, until you resume (Ctrl+Shift+T)")
        if is_toggled:
            dispatch(StopAfterClip(is_wanted))


def _draw_rows(queue: QueueStatus, dispatch: Dispatch, ui: UiState) -> None:
    n = len(queue.waiting)
    if not n:
        return
    height = min(n, MAX_ROWS) * ROW_HEIGHT + 6.0
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(2, 2))
    if imgui.begin_child("waiting", ImVec2(0, height)):
        clipper = imgui.ListClipper()
        clipper.begin(n, ROW_HEIGHT)
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                _draw_row(queue, place, dispatch, ui)
        clipper.end()
    imgui.end_child()
    imgui.pop_style_var()


def _draw_row(queue: QueueStatus, place: int, dispatch: Dispatch, ui: UiState) -> None:
    clip = queue.waiting[place]
    index = clip.clip_index
    imgui.push_id(f"queued {index}")
    buttons = 3 * (BUTTON_WIDTH + 2)
    width = max(imgui.get_content_region_avail().x - buttons, 40.0)
    start = imgui.get_cursor_pos()
    is_chosen = ui.queue_chosen == index
    if imgui.selectable("##row", is_chosen, 0, ImVec2(width, ROW_HEIGHT - 2))[0]:
        ui.queue_chosen = None if is_chosen else index
    ui.mark(f"queue.clip{index}")
    if imgui.begin_drag_drop_source():
        imgui.set_drag_drop_payload_py_id(PAYLOAD, index)
        imgui.text(f"Clip {index}")
        imgui.end_drag_drop_source()
    if imgui.begin_drag_drop_target():
        dropped = imgui.accept_drag_drop_payload_py_id(PAYLOAD)
        if dropped is not None:
            dispatch(MoveInQueue(dropped.data_id, place))
        imgui.end_drag_drop_target()
    own = f"  {Icon.GEAR}" if clip.has_own_settings else ""
    seconds = "" if clip.seconds is None else duration_text(clip.seconds)
    imgui.set_cursor_pos(ImVec2(start.x + 6, start.y + 3))
    imgui.text(elided(f"Clip {index}{own}", width - imgui.calc_text_size(seconds).x - 16))
    imgui.same_line()
    imgui.set_cursor_pos_x(start.x + width - imgui.calc_text_size(seconds).x - 6)
    imgui.text_disabled(seconds)
    imgui.set_cursor_pos(ImVec2(start.x + width + 2, start.y))
    imgui.begin_disabled(place == 0)
    if _small(Icon.UP, f"queue.up{index}", "Earlier", ui):
        dispatch(MoveInQueue(index, place - 1))
    imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(place == len(queue.waiting) - 1)
    if _small(Icon.DOWN, f"queue.down{index}", "Later", ui):
        dispatch(MoveInQueue(index, place + 1))
    imgui.end_disabled()
    imgui.same_line()
    if _small(Icon.CLOSE, f"queue.remove{index}", "Remove from the queue", ui):
        dispatch(RemoveFromQueue(index))
    imgui.pop_id()


def _small(icon: str, name: str, tooltip: str, ui: UiState) -> bool:
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 3))
    is_clicked = imgui.button(f"{icon}##{name}", ImVec2(BUTTON_WIDTH, ROW_HEIGHT - 2))
    imgui.pop_style_var()
    ui.mark(name)
    imgui.set_item_tooltip(tooltip)
    return is_clicked


def _draw_failed(clip_index: int, reason: str, dispatch: Dispatch, ui: UiState) -> None:
    imgui.push_id(f"failed {clip_index}")
    imgui.text_colored(ImVec4(*theme.VERMILLION), f"{Icon.WARNING}  Clip {clip_index} failed")
    imgui.same_line()
    if imgui.small_button("Retry"):
        dispatch(TrainClip(clip_index))
    ui.mark(f"queue.retry{clip_index}")
    text_wrapped_dim(reason)
    imgui.pop_id()


def draw_live_view(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """How often the clip that trains is shown anew."""
    imgui.align_text_to_frame_padding()
    imgui.text("Live view")
    for mode, (word, tooltip) in LIVE_WORDS.items():
        imgui.same_line(0, 6)
        is_on = session.queue.live_view == mode
        if is_on:
            imgui.push_style_color(imgui.Col_.button, ImVec4(*theme.RAISED_ACTIVE))
            imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.SKY))
        if imgui.small_button(f"{word}##live"):
            dispatch(SetLiveView(mode))
        if is_on:
            imgui.pop_style_color(2)
        ui.mark(f"training.live.{mode}")
        imgui.set_item_tooltip(f"{tooltip}; training continues.")


def draw_usage(usage: UsageStatus, ui: UiState) -> None:
    """Memory and processor of window and training."""
    rows = (("Training", usage.training_mb, usage.training_cores), ("Window", usage.window_mb, usage.window_cores))
    for name, megabytes, cores in rows:
        if megabytes is None and cores is None:
            continue
        memory = "memory not known" if megabytes is None else size_text(megabytes)
        processor = "" if cores is None else f", {cores:.1f} of {usage.n_cores} cores"
        imgui.text_disabled(name)
        text_right(f"{memory}{processor}")
    ui.mark("training.usage")
