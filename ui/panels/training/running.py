"""All clips in training, here and on other computers, in the training panel: how far each is, and the computers.

A row goes to its clip, and has buttons that hold it and end it; the same are actions for the clip at the playhead.
"""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, ImVec4, imgui

from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import PauseTraining, ResumeTraining, StopTraining
from app.status import MachineStatus, RunningClip
from engine.text import size_text
from ui.panels.pieces.widgets import elided, text_right, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.panels.training.clip_training_menu import draw_clip_training
from ui.panels.training.queue import clips_text
from ui.style import theme
from ui.style.progress_words import running_words, whole_words
from ui.style.theme import Icon

MAX_ROWS = 5
ROW_HEIGHT = 44.0
BUTTON_WIDTH = 26.0
BAR_HEIGHT = 4.0
CLIP_STATES = {"starting": "preparing", "preparing": "preparing", "paused": "paused"}
"""States of a training that a clip has by another name, for its symbol and colour; it is "training" in all others."""


def is_listed(session: SessionView) -> bool:
    """Whether trainings are listed: where more than one clip trains, or one elsewhere."""
    trainings = session.training.trainings
    return len(trainings) > 1 or any(one.is_elsewhere for one in trainings)


def draw_running(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """How far all of it is, a row for each clip in training, and the computers."""
    trainings = session.training.trainings
    imgui.spacing()
    text_wrapped_dim(whole_words(len(session.clips), session.training, session.queue))
    ui.mark("running.whole")
    height = min(len(trainings), MAX_ROWS) * ROW_HEIGHT + 2.0
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(2, 2))
    if imgui.begin_child("running", ImVec2(0, height), imgui.ChildFlags_.nav_flattened):
        clipper = imgui.ListClipper()
        clipper.begin(len(trainings), ROW_HEIGHT)
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                _draw_row(trainings[place], session, dispatch, ui)
        clipper.end()
    imgui.end_child()
    imgui.pop_style_var()
    _draw_machines(session.training.machines, ui)


def _draw_row(one: RunningClip, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    index, clip = one.clip_index, session.timeline.clip
    imgui.push_id(f"running {index}")
    start, avail = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    width = max(avail - 2 * (BUTTON_WIDTH + 2), 40.0)
    is_viewed = clip is not None and clip.clip_index == index
    if imgui.selectable("##row", is_viewed, 0, ImVec2(width, ROW_HEIGHT - 4))[0] and index < len(session.clips):
        dispatch(SetFrame(session.clips[index].start))
    ui.mark(f"running.clip{index}")
    imgui.set_item_tooltip(f"Clip {index}: {running_words(one)}")
    imgui.open_popup_on_item_click("menu", imgui.PopupFlags_.mouse_button_right)
    if imgui.begin_popup("menu"):
        imgui.text_disabled(f"Clip {index}")
        imgui.separator()
        draw_clip_training(session, dispatch, ui, index)
        imgui.end_popup()
    _draw_words(one, start, width)
    imgui.set_cursor_pos(ImVec2(start.x + width + 2, start.y))
    imgui.begin_disabled(one.state == "stopping")
    if one.state == "paused":
        if _button(Icon.PLAY, f"running.resume{index}", f"Resume clip {index}", ui):
            dispatch(ResumeTraining(index))
    elif _button(Icon.PAUSE, f"running.pause{index}", f"Pause clip {index}", ui):
        dispatch(PauseTraining(index))
    imgui.same_line()
    if _button(Icon.STOP, f"running.stop{index}", f"Stop clip {index}; its progress is kept", ui):
        dispatch(StopTraining(index))
    imgui.end_disabled()
    imgui.set_cursor_pos(ImVec2(start.x, start.y + ROW_HEIGHT - 2))
    imgui.dummy(ImVec2(0, 0))
    imgui.pop_id()


def _draw_words(one: RunningClip, start: ImVec2, width: float) -> None:
    """Over the row: number and share, a bar, and where, how fast and how long."""
    state = CLIP_STATES.get(one.state, "training")
    color, share = theme.status_color(state), one.step / one.n_steps if one.n_steps else 0.0
    imgui.set_cursor_pos(ImVec2(start.x + 6, start.y + 1))
    imgui.text_colored(ImVec4(*color), theme.CLIP_ICONS[state])
    imgui.same_line(0, 6)
    imgui.text(f"Clip {one.clip_index}")
    percent = f"{100 * share:.0f} %" if one.n_steps else "" if one.state == "unknown" else one.state
    imgui.same_line()
    imgui.set_cursor_pos_x(start.x + width - imgui.calc_text_size(percent).x - 6)
    imgui.text(percent)
    imgui.set_cursor_pos(ImVec2(start.x + 6, start.y + 21))
    words = running_words(one, is_short=True)
    if imgui.calc_text_size(words).x > width - 12:
        words = running_words(replace(one, worker=0), is_short=True)
    imgui.text_disabled(elided(words, width - 12))
    low = imgui.get_window_pos()
    x0, y0 = low.x + start.x - imgui.get_scroll_x() + 6, low.y + start.y - imgui.get_scroll_y() + ROW_HEIGHT - 8
    draw, end = imgui.get_window_draw_list(), x0 + width - 12
    draw.add_rect_filled(ImVec2(x0, y0), ImVec2(end, y0 + BAR_HEIGHT), theme.u32(theme.RAISED), 2)
    filled = ImVec2(x0 + (width - 12) * min(share, 1.0), y0 + BAR_HEIGHT)
    draw.add_rect_filled(ImVec2(x0, y0), filled, theme.u32(color), 2)


def _button(icon: str, name: str, tooltip: str, ui: UiState) -> bool:
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 3))
    is_clicked = imgui.button(f"{icon}##{name}", ImVec2(BUTTON_WIDTH, ROW_HEIGHT - 12))
    imgui.pop_style_var()
    ui.mark(name)
    imgui.set_item_tooltip(tooltip)
    return is_clicked


# ---- computers -------------------------------------------------------------------------------------------------


def machine_words(machine: MachineStatus) -> str:
    """Load and free memory of a computer, as far as they are known."""
    cores = f"{machine.n_cores} cores" if machine.n_cores else ""
    load = "" if machine.load is None else f"load {machine.load:.1f}"
    free = "" if machine.free_mb is None else f"{size_text(machine.free_mb)} free"
    return ", ".join(filter(None, (cores, load, free)))


def _draw_machines(machines: tuple[MachineStatus, ...], ui: UiState) -> None:
    if not machines:
        return
    is_open = imgui.collapsing_header(f"Computers: {len(machines)}###computers", imgui.TreeNodeFlags_.default_open)
    ui.mark("running.computers")
    if not is_open:
        return
    for place, machine in enumerate(machines):
        words = machine_words(machine)
        room = imgui.get_content_region_avail().x - imgui.calc_text_size(words).x - 16
        name = f"{machine.name}, here" if machine.is_here else machine.name
        imgui.text(name if imgui.calc_text_size(name).x <= room else elided(machine.name, room))
        imgui.set_item_tooltip(
            f"{name}, {clips_text(machine.n_clips)} in training.\nLoad: processes that want to run, in the last minute."
        )
        ui.mark(f"running.computer{place}")
        text_right(words)
