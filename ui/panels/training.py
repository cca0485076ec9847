"""The training panel: what runs, how fast, how well, and the buttons that start, pause and stop it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from app.session.commands import PauseTraining, ResumeTraining, StopTraining, TrainNextClip
from app.status import ClipStatus, PlanStatus, TrainingStatus
from engine.capture.clip import Clip
from engine.text import duration_text
from ui.panels.clip_quality import draw_clip_quality
from ui.panels.plan import draw_plan
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.clip_words import STATE_WORDS, state_note
from ui.panels.widgets import primary_button, text_right, text_wrapped_dim
from ui.style import theme
from ui.style.axis import ticks_that_fit, whole_ticks
from ui.style.numbers import format_count
from ui.style.progress_words import stage_words
from ui.style.theme import Icon

MAX_PLOT_POINTS = 600
TICK_ROOM = 52.0
"""What the numbers on the left and the margins take of a plot, units."""
MIN_TICK_DISTANCE = 46.0
ROOM_BELOW, QUALITY_ROOM = 190.0, 240.0
"""Room below the curves for the clips, and for the quality over them when it is folded out, units."""
ANCHORS_TOOLTIP = """All anchors of a clip, whichever frames they are alive in.
Reference clip: reference anchors, which later clips inherit.
Later clips: inherited + residual anchors."""


class TrainingNeeds(Protocol):
    """What this panel reads."""

    @property
    def capture(self) -> object | None: ...

    @property
    def training(self) -> TrainingStatus: ...

    @property
    def clips(self) -> Sequence[Clip]: ...

    @property
    def clip_states(self) -> Sequence[ClipStatus]: ...

    @property
    def plan(self) -> PlanStatus | None: ...

    @property
    def reference_index(self) -> int: ...


def plot_arrays(history: Sequence[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """(step, value) pairs as two contiguous float64 arrays, finite rows only, thinned to MAX_PLOT_POINTS."""
    pairs = np.asarray(list(history), dtype=np.float64).reshape(-1, 2)
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if len(pairs) > MAX_PLOT_POINTS:
        rows = np.linspace(0, len(pairs) - 1, MAX_PLOT_POINTS).round().astype(np.int64)
        pairs = pairs[rows]
    return np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])


def draw_training(session: TrainingNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """Buttons, progress, curves, quality over the clips, then one row per clip."""
    if session.capture is None:
        text_wrapped_dim("Training starts from here when a capture is open.")
        return
    status = session.training
    _draw_buttons(session, dispatch, ui)
    if status.state in ("starting", "preparing", "running", "paused", "stopping"):
        _draw_progress(status, ui)
    imgui.spacing()
    _draw_curves(status, ui)
    draw_clip_quality(session.clip_states, ui)
    imgui.spacing()
    _draw_clips(session)


def next_label(session: TrainingNeeds) -> str:
    """What starts the next clip, with its icon: a clip that was stopped goes on where that was."""
    index, step = session.training.next_clip_index, session.training.resume_step
    if index is None:
        is_all = all(state.state == "trained" for state in session.clip_states)
        return f"{Icon.CHECK}  Every clip is trained" if is_all else f"{Icon.WARNING}  No clip can be trained next"
    if step is not None:
        return f"{Icon.PLAY}  Resume clip {index} at step {format_count(step)}"
    return f"{Icon.TRAIN}  Train next clip"


def _draw_buttons(session: TrainingNeeds, dispatch: Dispatch, ui: UiState) -> None:
    status = session.training
    width = imgui.get_content_region_avail().x
    if status.state in ("idle", "failed"):
        index = status.next_clip_index
        is_offered = bool(status.can_train_next) and index is not None
        imgui.begin_disabled(not is_offered)
        if primary_button(next_label(session), ImVec2(width, 36), ui):
            dispatch(TrainNextClip())
        ui.mark("training.next")
        imgui.end_disabled()
        imgui.set_item_tooltip("T")
        if index is not None and index < len(session.clips):
            clip = session.clips[index]
            kind = (
                "the reference that the others start from"
                if index == session.reference_index
                else "it starts from the reference"
            )
            if status.resume_step is not None:
                kind = f"stopped at step {format_count(status.resume_step)}"
            text_wrapped_dim(f"Next: clip {index}, frames {clip.start} to {clip.stop - 1}, {kind}.")
        if session.plan is not None:
            draw_plan(session.plan, dispatch, ui)
        return
    half = (width - 8) / 2
    if status.state == "paused":
        if primary_button(f"{Icon.PLAY}  Resume", ImVec2(half, 36), ui):
            dispatch(ResumeTraining())
        ui.mark("training.resume")
    else:
        imgui.begin_disabled(status.state not in ("running", "preparing"))
        if imgui.button(f"{Icon.PAUSE}  Pause", ImVec2(half, 36)):
            dispatch(PauseTraining())
        ui.mark("training.pause")
        imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(status.state == "stopping")
    if imgui.button(f"{Icon.STOP}  Stop", ImVec2(half, 36)):
        dispatch(StopTraining())
    ui.mark("training.stop")
    imgui.end_disabled()
    imgui.set_item_tooltip("Ends this clip now and keeps what it learned")


def _draw_progress(status: TrainingStatus, ui: UiState) -> None:
    is_stepping = status.n_steps > 0 and status.state in ("running", "paused", "stopping")
    share = status.step / status.n_steps if is_stepping else float(getattr(status, "progress", 0.0) or 0.0)
    words = {"starting": "Starting", "preparing": "Preparing", "running": "Training"}
    words |= {"paused": "Paused", "stopping": "Stopping"}
    imgui.spacing()
    imgui.text(f"{words[status.state]} clip {status.clip_index}")
    if status.stage:
        text_wrapped_dim(stage_words(status))
    bar_color = theme.YELLOW if status.state == "paused" else theme.SKY
    imgui.push_style_color(imgui.Col_.plot_histogram, ImVec4(*bar_color))
    imgui.progress_bar(min(max(share, 0.0), 1.0), ImVec2(-1, 8), "")
    imgui.pop_style_color()
    ui.mark("training.progress")
    if is_stepping:
        _pair(f"Step {format_count(status.step)} of {format_count(status.n_steps)}", f"{share * 100:.0f} %")
        rate = f"{status.steps_per_s:.1f} steps/s" if status.steps_per_s else "–"
        _pair(rate, f"{duration_text(status.eta_s)} left")
    else:
        left = "" if status.eta_s is None else f"about {duration_text(status.eta_s)} left"
        _pair(left, f"{share * 100:.0f} % of this stage" if share > 0 else "")
    if status.message:
        text_wrapped_dim(str(status.message))


def _pair(left: str, right: str) -> None:
    imgui.text(left)
    text_right(right)


def _draw_curves(status: TrainingStatus, ui: UiState) -> None:
    below = ROOM_BELOW + (QUALITY_ROOM if ui.is_quality_open else 0.0)
    height = min(max((imgui.get_content_region_avail().y - below) / 2, 84.0), 150.0)
    n_steps = 0 if status.state in ("idle", "failed") else status.n_steps
    of_clip = "" if status.curve_clip_index is None else f" of clip {status.curve_clip_index}"
    _draw_curve(
        f"Held-out PSNR{of_clip}, dB", status.psnr_history, theme.GREEN, height, n_steps, has_markers=True, digits=2
    )
    ui.mark("training.psnr")
    _draw_curve(f"Loss{of_clip}", status.loss_history, theme.SKY, height, n_steps, has_markers=False, digits=4)
    ui.mark("training.loss")


def _draw_curve(
    title: str,
    history: Sequence[tuple[int, float]],
    color: theme.Color,
    height: float,
    n_steps: int,
    *,
    has_markers: bool,
    digits: int,
) -> None:
    """One curve over the steps of the whole clip, so that it also shows how far the training has come."""
    steps, values = plot_arrays(history)
    _pair(title, f"{values[-1]:.{digits}f}" if len(values) else "–")
    flags = implot.Flags_.canvas_only | implot.Flags_.no_inputs | implot.Flags_.no_frame
    if not implot.begin_plot(f"##{title}", ImVec2(-1, height), flags):
        return
    axis = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight | implot.AxisFlags_.no_tick_marks
    if len(values):
        low, high = float(values.min()), float(values.max())
        margin = max((high - low) * 0.1, abs(high) * 0.01, 1e-6)
        implot.setup_axes("", "", axis, axis)
        last = float(max(steps[-1], n_steps, 10))
        implot.setup_axes_limits(0.0, last, low - margin, high + margin, implot.Cond_.always)
        _set_step_ticks(last)
        spec = implot.Spec(line_color=ImVec4(*color), line_weight=2.0)
        if has_markers:
            spec.marker = implot.Marker_.circle
            spec.marker_size = 3.0
        implot.plot_line(title, steps, values, spec=spec)
    else:
        bare = axis | implot.AxisFlags_.no_decorations
        implot.setup_axes("", "", bare, bare)
        implot.setup_axes_limits(0.0, 1.0, 0.0, 1.0, implot.Cond_.always)
        implot.plot_text("appears while a clip trains", 0.5, 0.5)
    implot.end_plot()


def _set_step_ticks(last: float) -> None:
    """Whole steps along the lower edge."""
    width = max(imgui.get_content_region_avail().x - TICK_ROOM, 40.0)
    ticks = whole_ticks(last, max(int(width / MIN_TICK_DISTANCE), 2))
    halves = {tick: imgui.calc_text_size(format_count(tick)).x / 2 for tick in ticks}
    kept = ticks_that_fit(last, width, halves, ticks)
    implot.setup_axis_ticks(implot.ImAxis_.x1, [float(tick) for tick in kept], [format_count(tick) for tick in kept])


def anchors_text(n_inherited: int, n_own: int) -> str:
    """Anchors of a clip: of the reference clip a number, of a later one a sum; a dash where there are none yet."""
    if not n_inherited and not n_own:
        return "–"
    return f"{format_count(n_inherited)} + {format_count(n_own)}" if n_inherited else format_count(n_own)


def _draw_clips(session: TrainingNeeds) -> None:
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.scroll_y
    flags |= imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.pad_outer_x
    if not imgui.begin_table("clips", 3, flags, ImVec2(0, max(imgui.get_content_region_avail().y - 4, 90))):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_setup_column("Clip", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("PSNR")
    imgui.table_setup_column("Anchors")
    imgui.table_headers_row()
    imgui.set_item_tooltip(ANCHORS_TOOLTIP)
    clipper = imgui.ListClipper()
    clipper.begin(min(len(session.clips), len(session.clip_states)))
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            _draw_clip_row(session.clips[index], session.clip_states[index])
    clipper.end()
    imgui.end_table()


def _draw_clip_row(clip: Clip, status: ClipStatus) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    icon = theme.CLIP_ICONS.get(status.state, "")
    words: str = STATE_WORDS.get(status.state, str(status.state))
    imgui.text(f"{clip.clip_index}")
    imgui.same_line(24)
    imgui.text_colored(ImVec4(*theme.status_color(status.state)), f"{icon}  {words}" if icon else words)
    note = state_note(status)
    if note:
        imgui.set_item_tooltip(note)
    imgui.table_next_column()
    imgui.text("–" if status.held_out_psnr is None else f"{status.held_out_psnr:.1f}")
    if status.exposure_change:
        imgui.set_item_tooltip(f"Exposure {100.0 * status.exposure_change:.1f} % from the reference clip's, removed")
    imgui.table_next_column()
    imgui.text(anchors_text(status.n_inherited, status.n_own))
    imgui.set_item_tooltip(ANCHORS_TOOLTIP)
