"""Speed against error as a picture, one row of panels per operation: every back end on every scene, then settings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.lab.bench.rows import SpeedError, Trade
from app.lab.figures import FAINT_COLOR, PALETTE, add_grid, new_figure, place_labels, use_log

_BACKENDS = {"cpu": ("o", "ours (numba, float32)"), "reference": ("D", "plain torch, float32")}
_OPERATIONS = {
    "raster": ("Rasterizer", "largest pixel error (colours in 0..1)"),
    "decode": ("Decode", "largest error of a value, relative to the largest"),
    "step": ("Training step", "largest pixel error (colours in 0..1)"),
}
_TRADES = {
    "step": ("Training step", "a step, ms", 1e3, "clip file, MB", "PSNR of held-out pictures, dB"),
    "clip": ("Clip", "training of two clips, s", 1.0, "both clip files, MB", "PSNR of held-out pictures, dB"),
    "export": ("Export", "writing a file, s", 1.0, "file, MB", "PSNR against the live picture, dB"),
}
"""Title, label of the time and its units per second, label of the size, label of the error."""
_GRADIENT_LABEL = "largest relative gradient error"


def draw_speed_error(marks: Sequence[SpeedError], path: Path, *, footer: str, trades: Sequence[Trade] = ()) -> None:
    """Write the chart as PNG.

    Args:
        marks: Of back ends.
        path: Where to write; an existing file is replaced.
        footer: Machine, versions and date.
        trades: Of settings; they or the marks are at least one.
    Raises:
        ValueError: There is nothing to draw.
        OSError: The file cannot be written.
    """
    operations = [name for name in _OPERATIONS if any(mark.operation == name for mark in marks)]
    traded = [name for name in _TRADES if any(trade.operation == name for trade in trades)]
    n_rows = len(operations) + len(traded)
    if not n_rows:
        raise ValueError("no marks to draw")
    figure = new_figure(12, 0.9 + 3.6 * n_rows)
    panels = figure.subplots(n_rows, 2, squeeze=False)
    for (left, right), operation in zip(panels[: len(operations)], operations, strict=True):
        chosen = [mark for mark in marks if mark.operation == operation]
        title, value_label = _OPERATIONS[operation]
        _draw(left, chosen, [mark.value_error for mark in chosen], value_label)
        _draw(right, chosen, [mark.gradient_error for mark in chosen], _GRADIENT_LABEL)
        left.set_ylabel("whole step, ms" if operation == "step" else "forward + backward pass, ms")
        left.set_title(f"{title}: speed against error", loc="left", fontsize=11, fontweight="bold")
        right.set_title("lower left is better", loc="right", fontsize=9, color=FAINT_COLOR)
        right.legend(handles=_legend(right, chosen), fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    figure.supxlabel(footer, fontsize=7, color=FAINT_COLOR)
    for (left, right), operation in zip(panels[len(operations) :], traded, strict=True):
        chosen = [trade for trade in trades if trade.operation == operation]
        title, time_label, per_second, size_label, error_label = _TRADES[operation]
        left.set_title(f"{title}: settings", loc="left", fontsize=11, fontweight="bold")
        right.set_title("lower left is better", loc="right", fontsize=9, color=FAINT_COLOR)
        _draw_trades(left, chosen, [trade.seconds * per_second for trade in chosen], time_label, error_label)
        _draw_trades(right, chosen, [trade.n_bytes / 1e6 for trade in chosen], size_label, error_label)
    figure.savefig(path, format="png")


def _draw(axes: Any, marks: Sequence[SpeedError], errors: Sequence[float], label: str) -> None:
    """Marks of one operation. A line joins the back ends of a scene; its slope is the cost of speed in accuracy."""
    from matplotlib.ticker import NullFormatter

    scenes = list(dict.fromkeys(mark.scene for mark in marks))
    smallest = 1e-9  # an error of exactly zero has no place on a logarithmic axis
    for index, scene in enumerate(scenes):
        color = PALETTE[index % len(PALETTE)]
        points = [
            (max(error, smallest), mark.total_ms, mark.backend)
            for mark, error in zip(marks, errors, strict=True)
            if mark.scene == scene
        ]
        axes.plot([x for x, _, _ in points], [y for _, y, _ in points], color=color, linewidth=0.8, alpha=0.5)
        for x, y, backend in points:
            is_ours = backend == "cpu"
            axes.plot(
                [x],
                [y],
                _BACKENDS[backend][0],
                color=color,
                markerfacecolor=color if is_ours else "white",
                markersize=8,
            )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.12)
    for axis, set_limits in ((axes.xaxis, axes.set_xlim), (axes.yaxis, axes.set_ylim)):
        low, high = (math.log10(limit) for limit in axis.get_view_interval())
        set_limits(10.0 ** math.floor(low), 10.0 ** math.ceil(high))  # whole decades: both ends have a label
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(label)
    add_grid(axes)


def _draw_trades(axes: Any, trades: Sequence[Trade], costs: Sequence[float], cost_label: str, error_label: str) -> None:
    """Marks of one operation with their settings. A line joins those that differ in one setting, the cheapest first."""
    marks = list(zip(trades, costs, strict=True))
    for index, line in enumerate(dict.fromkeys(trade.line for trade in trades)):
        points = sorted((cost, trade.psnr_db) for trade, cost in marks if trade.line == line)
        axes.plot([psnr for _, psnr in points], [cost for cost, _ in points], "o-", color=PALETTE[index % len(PALETTE)])
    axes.margins(0.22)
    use_log(axes, "y")
    axes.invert_xaxis()
    axes.set_xlabel(f"{error_label}, falling")
    axes.set_ylabel(cost_label)
    add_grid(axes)
    named = {(cost, trade.psnr_db, trade.setting) for trade, cost in marks}  # the defaults lie on every line
    named = sorted(named, reverse=True)  # of neighbours the upper one is labelled above
    place_labels(axes.figure, axes, [name for *_, name in named], [(psnr, cost) for cost, psnr, _ in named])


def _legend(axes: Any, marks: Sequence[SpeedError]) -> list[Any]:
    from matplotlib.lines import Line2D

    scenes = {mark.scene: mark.size for mark in marks}
    handles = [
        Line2D([], [], color=PALETTE[i % len(PALETTE)], linewidth=3, label=f"{scene}: {size}")
        for i, (scene, size) in enumerate(scenes.items())
    ]
    for backend, (shape, label) in _BACKENDS.items():
        face = FAINT_COLOR if backend == "cpu" else "white"
        handles.append(
            Line2D(
                [], [], linestyle="", marker=shape, color=FAINT_COLOR, markerfacecolor=face, markersize=8, label=label
            )
        )
    return handles
