"""Speed against error as a picture: every back end on every scene, one row of panels per operation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.lab.bench.rows import SpeedError
from app.lab.figures import FAINT_COLOR, PALETTE, add_grid, new_figure

_BACKENDS = {"cpu": ("o", "ours (numba, float32)"), "reference": ("D", "plain torch, float32")}
_OPERATIONS = {
    "raster": ("Rasterizer", "largest pixel error (colours in 0..1)"),
    "decode": ("Decode", "largest error of a value, relative to the largest"),
    "step": ("Training step", "largest pixel error (colours in 0..1)"),
}
_GRADIENT_LABEL = "largest relative gradient error"


def draw_speed_error(marks: Sequence[SpeedError], path: Path, *, footer: str) -> None:
    """Write the chart as PNG.

    Args:
        marks: At least one.
        path: Where to write; an existing file is replaced.
        footer: Machine, versions and date.
    Raises:
        ValueError: There is nothing to draw.
        OSError: The file cannot be written.
    """
    operations = [name for name in _OPERATIONS if any(mark.operation == name for mark in marks)]
    if not operations:
        raise ValueError("no marks to draw")
    figure = new_figure(12, 0.9 + 3.6 * len(operations))
    panels = figure.subplots(len(operations), 2, squeeze=False)
    for (left, right), operation in zip(panels, operations, strict=True):
        chosen = [mark for mark in marks if mark.operation == operation]
        title, value_label = _OPERATIONS[operation]
        _draw(left, chosen, [mark.value_error for mark in chosen], value_label)
        _draw(right, chosen, [mark.gradient_error for mark in chosen], _GRADIENT_LABEL)
        left.set_ylabel("whole step, ms" if operation == "step" else "forward + backward pass, ms")
        left.set_title(f"{title}: speed against error", loc="left", fontsize=11, fontweight="bold")
        right.set_title("lower left is better", loc="right", fontsize=9, color=FAINT_COLOR)
        right.legend(handles=_legend(right, chosen), fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    figure.supxlabel(footer, fontsize=7, color=FAINT_COLOR)
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
