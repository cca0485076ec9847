"""Curves of trainings: held-out PSNR and loss of one clip or several, over the steps. Both plots share the steps.

Drawn with ImPlot; the wheel zooms, a drag pans, a double click shows everything again. Values follow the pointer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from app.session.session_view import SessionView
from ui.panels.pieces.widgets import text_right
from ui.panels.state import UiState
from ui.panels.timeline.clip_words import STATE_WORDS
from ui.panels.training.curve_view import MAX_CHOSEN, CurveView, value_at, value_range
from ui.style import theme
from ui.style.axis import log_ticks, round_ticks, tick_text
from ui.style.colors import GREEN, ORANGE, PURPLE, SKY, VERMILLION, YELLOW
from ui.style.numbers import format_count

MAX_PLOT_POINTS = 600
LOWEST, HIGHEST = 84.0, 130.0
"""Height of a plot, units: as much as a panel has to spare."""
ROOM_BELOW = 210.0
"""For the parts below the plots, units."""
MAX_MARKED = 30
"""Points; more of them stand so close that marks hide the line."""
TICK_DISTANCE = 52.0
ROW_DISTANCE = 24.0
TICK_ROOM = 52.0
"""Room of a plot for the numbers on the left and the margins, units."""
CLIP_HUES = (SKY, ORANGE, GREEN, PURPLE, VERMILLION, YELLOW)
MENU_HEIGHT = 260.0
HELP = "Wheel: zoom. Drag: move. Double click: everything."

Points = Sequence[tuple[int, float]]


@dataclass(frozen=True)
class Curve:
    """One line. steps, values: float64 [n]"""

    clip_index: int
    color: theme.Color
    steps: np.ndarray
    values: np.ndarray


def plot_arrays(history: Sequence[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """(step, value) pairs as two contiguous float64 arrays, finite rows only."""
    pairs = np.asarray(list(history), dtype=np.float64).reshape(-1, 2)
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    return np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])


def seen_part(steps: np.ndarray, values: np.ndarray, limits: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """The part of a curve between two steps with a point beyond each end, at most MAX_PLOT_POINTS of it."""
    first = max(int(np.searchsorted(steps, limits[0])) - 1, 0)
    stop = min(int(np.searchsorted(steps, limits[1], side="right")) + 1, len(steps))
    rows = np.arange(first, stop)
    if len(rows) > MAX_PLOT_POINTS:
        rows = rows[np.linspace(0, len(rows) - 1, MAX_PLOT_POINTS).round().astype(np.int64)]
    return np.ascontiguousarray(steps[rows]), np.ascontiguousarray(values[rows])


def draw_curves(session: SessionView, ui: UiState) -> None:
    """A row to choose with, the plot of PSNR and the plot of the loss."""
    view, status = ui.curves, session.training
    shown = view.shown(status.curve_clip_index, len(session.clip_states))
    _draw_choice(session, shown, ui)
    histories = _histories(session, shown)
    is_single = len(shown) <= 1
    psnr, loss = [], []
    for place, index in enumerate(shown):
        found_loss, found_psnr = histories[index]
        hue = CLIP_HUES[place % len(CLIP_HUES)]
        psnr.append(Curve(index, GREEN if is_single else hue, *plot_arrays(found_psnr)))
        loss.append(Curve(index, SKY if is_single else hue, *plot_arrays(found_loss)))
    is_training = status.state not in ("idle", "failed") and status.clip_index in shown
    ends = [float(curve.steps[-1]) for curve in (*psnr, *loss) if len(curve.steps)]
    last = max([*ends, float(status.n_steps) if is_training else 0.0, 10.0])
    height = min(max((imgui.get_content_region_avail().y - ROOM_BELOW) / 2, LOWEST), HIGHEST)
    pointer_step, view.pointer_step = view.pointer_step, None
    of_clip = f" of clip {shown[0]}" if len(shown) == 1 else ""
    is_aligned = implot.begin_aligned_plots("curves")  # the same step stands over itself
    title = f"Held-out PSNR{of_clip}, few pictures, dB"
    _draw_plot(title, "psnr", psnr, last, pointer_step, height, ui, is_log=False, digits=2)
    _draw_plot(f"Loss{of_clip}", "loss", loss, last, pointer_step, height, ui, is_log=view.is_log, digits=4)
    if is_aligned:
        implot.end_aligned_plots()
    if view.pointer_step != pointer_step:
        ui.redraw_within(0.0)  # the other plot shows it, too


def _histories(session: SessionView, shown: Sequence[int]) -> dict[int, tuple[Points, Points]]:
    """Loss and PSNR of each; empty until they are read. One that is missing is asked for at a time."""
    found: dict[int, tuple[Points, Points]] = {index: ((), ()) for index in shown}
    for index in shown:
        curves = session.clip_curves(index)
        if curves is None:
            break
        found[index] = curves
    return found


def _draw_choice(session: SessionView, shown: Sequence[int], ui: UiState) -> None:
    view = ui.curves
    label = "Clips" if not view.chosen else f"Clips {', '.join(str(index) for index in shown)}"
    if imgui.small_button(f"{label}###curve clips"):
        imgui.open_popup("curve clips")
    ui.mark("curves.clips")
    imgui.set_item_tooltip("Choose the clips whose curves are shown")
    imgui.same_line()
    if view.is_log:
        imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.SKY))
    is_clicked = imgui.small_button("log loss")
    if view.is_log:
        imgui.pop_style_color()
    if is_clicked:
        view.is_log = not view.is_log
    ui.mark("curves.log")
    imgui.set_item_tooltip("Loss on a logarithmic scale")
    if view.span is not None:
        imgui.same_line()
        if imgui.small_button("all steps"):
            view.show_all()
        ui.mark("curves.all")
    imgui.set_next_window_size_constraints(ImVec2(0, 0), ImVec2(1e4, MENU_HEIGHT))
    if not imgui.begin_popup("curve clips"):
        return
    imgui.text_disabled(f"Up to {MAX_CHOSEN}; if none, the clip in training or at the playhead")
    if view.chosen and imgui.small_button("None"):
        view.chosen = []
    clipper = imgui.ListClipper()
    clipper.begin(len(session.clip_states))
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            state = session.clip_states[index].state
            is_toggled, _ = imgui.checkbox(f"Clip {index}##{index}", index in view.chosen)
            ui.mark(f"curves.clip{index}")
            if is_toggled:
                view.toggle(index)
            if state != "trained":
                imgui.same_line()
                imgui.text_disabled(STATE_WORDS.get(state, state))
    clipper.end()
    imgui.end_popup()


def _draw_plot(
    title: str,
    name: str,
    curves: Sequence[Curve],
    last: float,
    pointer_step: float | None,
    height: float,
    ui: UiState,
    *,
    is_log: bool,
    digits: int,
) -> None:
    view = ui.curves
    _draw_title(title, curves, digits)
    flags = implot.Flags_.canvas_only | implot.Flags_.no_inputs | implot.Flags_.no_frame
    if not implot.begin_plot(f"##{name}", ImVec2(-1, height), flags):
        return
    limits = view.limits(last)
    found = value_range([(curve.steps, curve.values) for curve in curves], limits, is_log=is_log)
    _set_axes(limits, found, height, is_log=is_log)
    if found is None:
        empty = "no values here" if any(len(curve.steps) for curve in curves) else "appears while a clip trains"
        implot.plot_text(empty, sum(limits) / 2, 0.5)
    else:
        for curve in curves:
            _draw_curve(curve, limits, has_markers=name == "psnr")
        if pointer_step is not None:
            line = implot.Spec(line_color=ImVec4(*theme.faded(theme.TEXT, 0.35)), line_weight=1.0)
            implot.plot_inf_lines("##pointer", np.array([pointer_step]), spec=line)
    corner, size = implot.get_plot_pos(), implot.get_plot_size()
    implot.end_plot()
    ui.mark(f"training.{name}")
    below = imgui.get_cursor_screen_pos()
    imgui.set_cursor_screen_pos(corner)
    imgui.invisible_button(f"inside {name}", ImVec2(max(size.x, 1.0), max(size.y, 1.0)))
    share = (imgui.get_io().mouse_pos.x - corner.x) / max(size.x, 1.0)
    at = limits[0] + share * (limits[1] - limits[0])
    _steer(view, at, last, max(size.x, 1.0))
    if imgui.is_item_hovered() and found is not None:
        view.pointer_step = at
        _draw_values(curves, at, digits)
    imgui.set_cursor_screen_pos(below)


def _draw_title(title: str, curves: Sequence[Curve], digits: int) -> None:
    imgui.text(title)
    if len(curves) == 1:
        values = curves[0].values
        text_right(f"{values[-1]:.{digits}f}" if len(values) else "–")
        return
    for curve in curves:
        imgui.same_line()
        imgui.text_colored(ImVec4(*curve.color), str(curve.clip_index))


def _set_axes(limits: tuple[float, float], found: tuple[float, float] | None, height: float, *, is_log: bool) -> None:
    axis = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight | implot.AxisFlags_.no_tick_marks
    if found is None:
        axis |= implot.AxisFlags_.no_decorations
    implot.setup_axes("", "", axis, axis)
    low, high = (0.0, 1.0) if found is None else found
    implot.setup_axes_limits(*limits, low, high, implot.Cond_.always)
    if found is None:
        return
    width = max(imgui.get_content_region_avail().x - TICK_ROOM, 40.0)
    steps = round_ticks(*limits, max(int(width / TICK_DISTANCE), 2), least=1.0)
    implot.setup_axis_ticks(implot.ImAxis_.x1, *_fitting(steps, limits, width))
    n_rows = max(int((height - 0.5 * ROW_DISTANCE) / ROW_DISTANCE), 2)
    if is_log:
        implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
        values = log_ticks(low, high, n_rows)
        implot.setup_axis_ticks(implot.ImAxis_.y1, values, [f"{value:.1g}" for value in values])
        return
    values = round_ticks(low, high, n_rows)
    apart = values[1] - values[0] if len(values) > 1 else high - low
    implot.setup_axis_ticks(implot.ImAxis_.y1, values, [tick_text(value, apart) for value in values])


def _fitting(ticks: Sequence[float], limits: tuple[float, float], width: float) -> tuple[list[float], list[str]]:
    """Steps and their words, without those whose word would stand out over the right edge."""
    kept = []
    for tick in ticks:
        half = imgui.calc_text_size(format_count(round(tick))).x / 2
        if (limits[1] - tick) / (limits[1] - limits[0]) * width + 4.0 >= half:
            kept.append(tick)
    return kept, [format_count(round(tick)) for tick in kept]


def _draw_curve(curve: Curve, limits: tuple[float, float], *, has_markers: bool) -> None:
    steps, values = seen_part(curve.steps, curve.values, limits)
    if not len(steps):
        return
    spec = implot.Spec(line_color=ImVec4(*curve.color), line_weight=2.0)
    if has_markers and len(steps) <= MAX_MARKED:
        spec.marker, spec.marker_size = implot.Marker_.circle, 3.0
    implot.plot_line(f"##{curve.clip_index}", steps, values, spec=spec)


def _steer(view: CurveView, at: float, last: float, width: float) -> None:
    """Wheel, drag and double click on the item drawn last: the inner part of a plot, `width` units wide."""
    io = imgui.get_io()
    low, high = view.limits(last)
    is_hovered = imgui.is_item_hovered()
    if is_hovered:
        imgui.set_item_key_owner(imgui.Key.mouse_wheel_y)  # the panel behind it does not scroll
    if is_hovered and imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
        view.show_all()
    elif is_hovered and io.mouse_wheel:
        view.zoom(io.mouse_wheel, at, last)
    elif imgui.is_item_active() and io.mouse_delta.x:
        view.pan(-io.mouse_delta.x * (high - low) / width, last)


def _draw_values(curves: Sequence[Curve], at: float, digits: int) -> None:
    points = [(curve, value_at(curve.steps, curve.values, at)) for curve in curves]
    known = [(curve, point) for curve, point in points if point is not None]
    if not known or not imgui.begin_tooltip():
        return
    for curve, (step, value) in known:
        clip = f"Clip {curve.clip_index}: " if len(curves) > 1 else ""
        imgui.text_colored(ImVec4(*curve.color), f"{clip}{value:.{digits}f}")
        imgui.same_line()
        imgui.text_disabled(f"at step {format_count(step)}")
    imgui.text_disabled(HELP)
    imgui.end_tooltip()
