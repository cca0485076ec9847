"""Quality over the clips, in the training panel: held-out PSNR of each, and how far exposure has gone by then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from app.psnr_words import psnr_label, psnr_note
from app.status import ClipStatus
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import UiState
from ui.style import theme
from ui.style.axis import ticks_that_fit, whole_ticks

PLOT_HEIGHT = 76.0
TICK_ROOM = 52.0
"""Room of a plot for the numbers on the left and the margins, units."""
MIN_TICK_DISTANCE = 30.0
LEAST_CLIPS = 2
"""With fewer there is nothing to compare."""
LEAST_CHANGE_PERCENT = 0.1
"""Below, exposure has not changed."""


@dataclass(frozen=True)
class ClipQuality:
    """Figures of the measured clips. All [n], rising clips.

    Attributes:
        clips: Clip indices. float64
        psnr: Held-out PSNR, dB. float64
        is_whole: Whether all of them are over every frame and held-out camera.
        exposure: How far exposure is from the reference clip's, percent; NaN where not known. float64
    """

    clips: np.ndarray
    psnr: np.ndarray
    exposure: np.ndarray
    is_whole: bool = True

    @property
    def title(self) -> str:
        """Lowest and highest figure; empty where there is nothing to compare."""
        if len(self.clips) < LEAST_CLIPS:
            return ""
        low, high = (psnr_label(float(value), is_whole=self.is_whole) for value in (self.psnr.min(), self.psnr.max()))
        return f"Quality over clips: {low} to {high} dB"

    @property
    def exposure_text(self) -> str:
        """How far exposure goes, and its correction."""
        largest = np.nanmax(self.exposure) if np.isfinite(self.exposure).any() else 0.0
        if largest < LEAST_CHANGE_PERCENT:
            return "The cameras' exposure does not change between clips."
        clip = int(self.clips[np.nanargmax(self.exposure)])
        return (
            f"The cameras' exposure is up to {largest:.1f} % from the reference clip's (clip {clip}); it was removed."
        )


def clip_quality(clip_states: Sequence[ClipStatus]) -> ClipQuality:
    """Of the clips that have a figure."""
    measured = [
        (index, status)
        for index, status in enumerate(clip_states)
        if status.held_out_psnr is not None and np.isfinite(status.held_out_psnr)
    ]
    rows = [
        (index, status.held_out_psnr, np.nan if status.exposure_change is None else 100.0 * status.exposure_change)
        for index, status in measured
    ]
    table = np.array(rows, np.float64).reshape(-1, 3)
    columns = (np.ascontiguousarray(column) for column in table.T)
    return ClipQuality(*columns, is_whole=all(status.held_out_whole for _, status in measured))


def draw_clip_quality(clip_states: Sequence[ClipStatus], ui: UiState) -> None:
    """A header that folds out to the plots; nothing where fewer than two clips have a figure."""
    quality = clip_quality(clip_states)
    if not quality.title:
        return
    imgui.set_next_item_open(ui.is_quality_open)
    is_open = imgui.collapsing_header(f"{quality.title}###quality")
    ui.mark("quality.header")
    imgui.set_item_tooltip(psnr_note(is_whole=quality.is_whole))
    if imgui.is_item_toggled_open():  # a header in a panel that is hidden for a frame says it is closed
        ui.is_quality_open = is_open
    if is_open:
        _draw_plots(quality, len(clip_states), ui)
    if is_open and not ui.is_quality_seen:
        imgui.set_scroll_here_y(1.0)
        ui.redraw_within(0.0)
    ui.is_quality_seen = is_open


def _draw_plots(quality: ClipQuality, n_clips: int, ui: UiState) -> None:
    low, high = float(quality.psnr.min()), float(quality.psnr.max())
    margin = max(0.15 * (high - low), 0.2)
    _draw_plot("psnr", quality.clips, quality.psnr, (low - margin, high + margin), theme.GREEN, n_clips)
    ui.mark("quality.psnr")
    is_known = np.isfinite(quality.exposure)
    if is_known.any() and quality.exposure[is_known].max() >= LEAST_CHANGE_PERCENT:
        imgui.text("Exposure, % from the reference clip")
        highest = 1.15 * float(quality.exposure[is_known].max())
        clips, exposure = (np.ascontiguousarray(values[is_known]) for values in (quality.clips, quality.exposure))
        _draw_plot("exposure", clips, exposure, (0.0, highest), theme.YELLOW, n_clips)
        ui.mark("quality.exposure")
    text_wrapped_dim(quality.exposure_text)


def _draw_plot(
    name: str, clips: np.ndarray, values: np.ndarray, limits: tuple[float, float], color: theme.Color, n_clips: int
) -> None:
    flags = implot.Flags_.canvas_only | implot.Flags_.no_inputs | implot.Flags_.no_frame
    if not implot.begin_plot(f"##quality.{name}", ImVec2(-1, PLOT_HEIGHT), flags):
        return
    axis = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_highlight | implot.AxisFlags_.no_tick_marks
    implot.setup_axes("", "", axis, axis)
    last = float(max(n_clips - 1, 1))
    implot.setup_axes_limits(-0.02 * last, 1.02 * last, *limits, implot.Cond_.always)
    width = max(imgui.get_content_region_avail().x - TICK_ROOM, 40.0)
    ticks = whole_ticks(last, max(int(width / MIN_TICK_DISTANCE), 2))
    halves = {tick: imgui.calc_text_size(str(tick)).x / 2 for tick in ticks}
    kept = ticks_that_fit(last, width, halves, ticks)
    implot.setup_axis_ticks(implot.ImAxis_.x1, [float(tick) for tick in kept], [str(tick) for tick in kept])
    spec = implot.Spec(line_color=ImVec4(*color), line_weight=2.0)
    spec.marker, spec.marker_size = implot.Marker_.circle, 3.0
    implot.plot_line(name, clips, values, spec=spec)
    implot.end_plot()
