"""Figures over a length, one small panel each, with the same line and mark for a project in all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.lab.figures import FAINT_COLOR, PALETTE, add_grid, new_figure, plain_texts, png_of
from app.lab.report.charts import WIDTH_INCHES, shortened

N_COLUMNS = 3
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
_STYLES = ("-", "--", ":", "-.")


@dataclass(frozen=True, slots=True)
class Series:
    """One line with marks. points: Length and figure; where that is None there is no mark."""

    label: str
    points: Sequence[tuple[int, float | None]]


@dataclass(frozen=True, slots=True)
class LengthPanel:
    """One figure. Its series are the same as those of every other panel, in the same order."""

    label: str
    series: Sequence[Series]


def draw_over_length(panels: Sequence[LengthPanel], x_label: str, ticks: Sequence[int] | None = None) -> bytes:
    """Panels in rows of three over one axis of frames, with one legend.

    Args:
        ticks: The lengths that there are, where they are few; chosen by the chart when None.
    """
    n_rows = -(-len(panels) // N_COLUMNS)
    with plain_texts():
        figure = new_figure(WIDTH_INCHES, 2.3 * n_rows + 0.6)
        grid = figure.subplots(n_rows, N_COLUMNS, squeeze=False).ravel()
        for axes in grid[len(panels) :]:
            axes.set_axis_off()
        for axes, panel in zip(grid, panels, strict=False):
            for i, series in enumerate(panel.series):
                known = [(x, y) for x, y in series.points if y is not None]
                xs, ys = [x for x, _ in known], [y for _, y in known]
                axes.plot(
                    xs,
                    ys,
                    color=PALETTE[i % len(PALETTE)],
                    linestyle=_STYLES[i // len(PALETTE) % len(_STYLES)],
                    marker=_MARKERS[i % len(_MARKERS)],
                    markersize=4.5,
                    linewidth=1.3,
                    label=shortened(series.label),
                )
            if not any(y is not None for series in panel.series for _, y in series.points):
                axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color=FAINT_COLOR)
            axes.set_title(panel.label, loc="left", fontsize=8.5)
            axes.set_xlabel(x_label, fontsize=8)
            axes.tick_params(labelsize=7.5)
            axes.margins(x=0.08, y=0.12)
            axes.ticklabel_format(axis="y", useOffset=False)
            if ticks is not None and len(ticks) <= 8:
                axes.set_xticks(ticks)
            else:
                axes.xaxis.get_major_locator().set_params(integer=True)
            add_grid(axes)
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=7.5, frameon=False)
        return png_of(figure)
