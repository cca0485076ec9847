"""The charts of a report as PNG files. Colours are Okabe and Ito's and cividis: distinct with any colour vision."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from app.lab.figures import FAINT_COLOR, PALETTE, add_grid, new_figure, place_labels, plain_texts, png_of, use_log
from app.lab.report.pareto import pareto_front

WIDTH_INCHES = 10.5
MAP_COLORS = "cividis"
LOG_FROM_RATIO = 5.0
"""A time axis is logarithmic when the longest time is that many times the shortest."""
_LABEL_LENGTH = 28
MAX_NAMED_MARKS = 6
"""Above so many results the marks are numbered, and the names stand next to the panels."""
MANY_VALUES = 100
"""Values over which lines are drawn thinner and without marks."""
MANY_BORDERS, MAX_BORDERS = 15, 120
"""Borders from which their lines are thinner, and from which none is drawn."""
MAX_BARS_INCHES, MAX_NAMED_BARS = 9.0, 30
"""Height at most of stacked bars, and how many of them are named."""
_STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True, slots=True)
class ChartLine:
    """One line over frames or clips; None where there is no value. Faint ones stand behind the others; a line without
    a label is not in the legend."""

    label: str
    values: Sequence[float | None]
    is_main: bool = False
    is_faint: bool = False


@dataclass(frozen=True, slots=True)
class CurvePanel:
    """Curves over the same frames, with the label of the vertical axis."""

    label: str
    curves: Sequence[ChartLine]


@dataclass(frozen=True, slots=True)
class MapPanel:
    """One map. values [H, W]; pixels that is_shown [H, W] bool leaves out are grey."""

    title: str
    values: np.ndarray
    is_shown: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class SpeedPanel:
    """A figure against time. `values` belong to the same results as the times; None leaves one out."""

    label: str
    values: Sequence[float | None]
    is_higher_better: bool


def draw_over_time(
    panels: Sequence[CurvePanel], frames: Sequence[int], borders: Sequence[int], unit: str = "frame"
) -> bytes:
    """Figures over frames, one panel below the other.

    Args:
        frames: Frame indices of the values, or other numbers that count time.
        borders: First frames of clips; a line stands before each, unless they are too many to be distinguished.
        unit: The unit of the axis. Where frames are missing, lines end and begin anew.
    """
    breaks = [
        i for i, (before, after) in enumerate(pairwise(frames), start=1) if unit == "frame" and after > before + 1
    ]
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, 0.4 + 2.5 * len(panels))
        rows = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axes, panel in zip(rows, panels, strict=True):
            _draw_curves(axes, panel, frames, breaks)
            for i, border in enumerate(borders if len(borders) <= MAX_BORDERS else ()):
                label = "clip border" if i == 0 else None
                width = 1.0 if len(borders) <= MANY_BORDERS else 0.5
                axes.axvline(border - 0.5, color=FAINT_COLOR, linestyle="--", linewidth=width, label=label)
            axes.set_ylabel(panel.label)
            add_grid(axes)
            axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
        rows[-1].set_xlabel(unit)
        rows[-1].xaxis.get_major_locator().set_params(integer=True)
        return png_of(figure)


def draw_training(curves: Mapping[str, Sequence[tuple[float, float]]], time_label: str, label: str) -> bytes:
    """A line per training: points of time and figure."""
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, 3.6)
        axes = figure.subplots()
        for i, (name, points) in enumerate(curves.items()):
            color, style = PALETTE[i % len(PALETTE)], _STYLES[i // len(PALETTE) % len(_STYLES)]
            axes.plot(*zip(*points, strict=True), color=color, linestyle=style, marker=".", label=name)
        axes.set_xlabel(time_label)
        axes.set_ylabel(label)
        add_grid(axes)
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
        return png_of(figure)


def _draw_curves(axes: Any, panel: CurvePanel, frames: Sequence[int], breaks: Sequence[int]) -> None:
    n_thin = 0
    has_many = len(frames) > MANY_VALUES
    places = np.insert(np.asarray(frames, dtype=float), breaks, math.nan)
    for curve in panel.curves:
        known = np.array([math.nan if value is None else value for value in curve.values])
        values = np.insert(known, breaks, math.nan)
        if curve.is_main:
            marker = "." if not has_many or has_lone_value(values) else None
            width = 1.4 if has_many else 2.2
            axes.plot(places, values, color="#000000", linewidth=width, marker=marker, label=curve.label, zorder=3)
            continue
        if curve.is_faint:
            axes.plot(places, values, color=FAINT_COLOR, alpha=0.35, linewidth=0.8, label=curve.label or "_")
            continue
        color, style = PALETTE[n_thin % (len(PALETTE) - 1)], _STYLES[n_thin // (len(PALETTE) - 1) % len(_STYLES)]
        marker = "." if has_lone_value(values) else None
        axes.plot(
            places,
            values,
            color=color,
            linestyle=style,
            linewidth=0.8 if has_many else 1.2,
            marker=marker,
            label=curve.label,
        )
        n_thin += 1


def has_lone_value(values: np.ndarray) -> bool:
    """Whether a value has none next to it, so that no line would show it. values: [N], NaN for none."""
    is_known = np.pad(~np.isnan(values), 1)
    return bool((is_known[1:-1] & ~is_known[:-2] & ~is_known[2:]).any())


def draw_pictures(truth: np.ndarray, render: np.ndarray, error_range: tuple[float, float]) -> bytes:
    """The captured picture, the render and the error side by side.

    Args:
        truth: [H, W, 3] uint8
        render: [H, W, 3] in 0..1
        error_range: Ends of the colour range of the mean absolute difference over the channels.
    """
    image = np.clip(np.nan_to_num(render), 0.0, 1.0)
    error = np.abs(image - truth / 255.0).mean(2)
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, _row_height(truth.shape, 3), dpi=150)
        columns = figure.subplots(1, 3)
        shown: Any = None
        for axes, picture, title in zip(columns, (truth, image, error), ("truth", "render", "error"), strict=True):
            shown = axes.imshow(picture, **map_options(error_range) if picture is error else {})
            axes.set_title(title, loc="left", fontsize=9)
            axes.set_axis_off()
        add_color_bar(figure, shown, columns, "mean absolute difference, colours in 0..1")
        return png_of(figure)


def draw_maps(panels: Sequence[MapPanel], value_range: tuple[float, float], label: str) -> bytes:
    """Maps side by side under one locked colour range."""
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, _row_height(panels[0].values.shape, len(panels)), dpi=150)
        columns = figure.subplots(1, len(panels), squeeze=False)[0]
        shown: Any = None
        for axes, panel in zip(columns, panels, strict=True):
            values = np.ma.masked_invalid(panel.values)
            if panel.is_shown is not None:
                values = np.ma.masked_where(~panel.is_shown, values)
            axes.set_facecolor("#B0B0B0")
            shown = axes.imshow(values, **map_options(value_range))
            axes.set_title(panel.title, loc="left", fontsize=8)
            axes.set_xticks([])
            axes.set_yticks([])
        add_color_bar(figure, shown, columns, label)
        return png_of(figure)


def map_options(value_range: tuple[float, float]) -> dict[str, Any]:
    """How `imshow` is to draw a map: colours, ends of their range, pixels as they are."""
    return {"cmap": MAP_COLORS, "vmin": value_range[0], "vmax": value_range[1], "interpolation": "nearest"}


def _row_height(shape: Sequence[int], n_panels: int) -> float:
    return max(0.88 * WIDTH_INCHES / n_panels * shape[0] / shape[1] + 0.35, 1.6)


def add_color_bar(figure: Any, shown: Any, axes: Any, label: str) -> None:
    """One bar for all axes. shown: The result of `imshow` for one of them."""
    bar = figure.colorbar(shown, ax=list(axes), fraction=0.04, pad=0.01, extend="max")
    bar.set_label(label, fontsize=7)
    bar.ax.tick_params(labelsize=7)


def draw_stacked(parts: Mapping[str, Sequence[float]], names: Sequence[str], label: str) -> bytes:
    """Horizontal bars, one per name, each put together from the parts in order. Parts without any value are left out.

    Args:
        parts: Name of a part to one value per bar.
        label: Of the horizontal axis.
    """
    hatches = ("", "//", "..", "xx")
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, min(max(1.0 + 0.32 * len(names), 2.2), MAX_BARS_INCHES))
        axes = figure.subplots()
        left = np.zeros(len(names))
        shown = [(part, np.asarray(values, dtype=float)) for part, values in parts.items() if any(values)]
        for i, (part, values) in enumerate(shown):
            color, hatch = PALETTE[i % len(PALETTE)], hatches[i // len(PALETTE) % len(hatches)]
            gap = {"edgecolor": "#FFFFFF", "lw": 0.5} if len(names) <= MANY_VALUES else {"height": 1.0}
            axes.barh(range(len(names)), values, left=left, color=color, hatch=hatch, label=part, **gap)
            left += values
        step = -(-len(names) // MAX_NAMED_BARS)
        axes.set_yticks(range(0, len(names), step), names[::step])
        axes.margins(y=0.3 / len(names) if len(names) > 1 else None)
        axes.invert_yaxis()
        axes.set_xlabel(label)
        add_grid(axes)
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
        return png_of(figure)


def draw_speed_error(
    names: Sequence[str], times: Sequence[float], panels: Sequence[SpeedPanel], own: int | None, time_label: str
) -> bytes:
    """Figures against wall time, a mark with a label per result, and the Pareto front.

    Args:
        names, times: One per result.
        time_label: The kind of the times, with their unit.
        own: Index of the result that the page is about; a diamond among circles.
        panels: At least one; those without any value stay empty.
    """
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, 4.2)
        labels = [shortened(name) for name in names]
        if len(names) > MAX_NAMED_MARKS:
            from matplotlib.lines import Line2D

            handles = [Line2D([], [], linestyle="", label=f"{i}  {label}") for i, label in enumerate(labels, start=1)]
            figure.legend(handles=handles, loc="outside right center", fontsize=7.5, handlelength=0, frameon=False)
            labels = [str(i) for i in range(1, len(names) + 1)]
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            _draw_speed_panel(figure, axes, labels, times, panel, own)
            axes.set_xlabel(time_label)
        return png_of(figure)


def _draw_speed_panel(
    figure: Any, axes: Any, labels: Sequence[str], all_times: Sequence[float], panel: SpeedPanel, own: int | None
) -> None:
    chosen = [i for i, value in enumerate(panel.values) if value is not None]
    points = [(all_times[i], float(panel.values[i] or 0.0)) for i in chosen]
    direction = "upper" if panel.is_higher_better else "lower"
    axes.set_title(f"{direction} left is better", loc="right", fontsize=8, color=FAINT_COLOR)
    axes.set_ylabel(panel.label)
    axes.margins(0.22)
    add_grid(axes)
    if not points:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color=FAINT_COLOR)
        return
    times = [x for x, _ in points]
    if min(times) > 0 and max(times) / min(times) >= LOG_FROM_RATIO:
        use_log(axes, "x")
    front = [points[i] for i in pareto_front(points, is_higher_better=panel.is_higher_better)]
    if len(points) > 1:
        xs, ys = zip(*front, strict=True)
        axes.step(xs, ys, where="post", color=PALETTE[1], linewidth=1.4, zorder=1, label="Pareto front")
        axes.legend(fontsize=7, loc="best", frameon=False)
    for index, (x, y) in zip(chosen, points, strict=True):
        is_front = (x, y) in front
        color = PALETTE[0] if is_front else FAINT_COLOR
        face = color if is_front else "white"
        axes.plot([x], [y], "D" if index == own else "o", color=color, markerfacecolor=face, markersize=8, zorder=3)
    place_labels(figure, axes, [labels[i] for i in chosen], points)


def shortened(name: str) -> str:
    """A name for a label: a long one without its middle."""
    return name if len(name) <= _LABEL_LENGTH else f"{name[: _LABEL_LENGTH // 2 - 1]}…{name[-_LABEL_LENGTH // 2 :]}"
