"""The common parts of all charts: palette, an off-screen figure, PNG bytes. Imports matplotlib only when one is made:
importing it takes longer than most commands."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette: distinguished with any colour vision."""
FAINT_COLOR, GRID_COLOR = "#555555", "#DDDDDD"
DPI = 110
_LABEL_OFFSETS = ((7, 5), (7, -12), (-7, 5), (-7, -12), (7, 17), (7, -24), (-7, 17), (-7, -24), (0, 29), (0, -36))
"""Places of a label next to its mark, points of the typeface; the first that is free is taken."""


def new_figure(width_inches: float, height_inches: float, *, dpi: float = DPI) -> Any:
    """An empty figure that is drawn without a screen; it lays its panels out itself."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_inches, height_inches), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def add_grid(axes: Any) -> None:
    """Thin grey lines behind the marks."""
    axes.grid(visible=True, which="major", color=GRID_COLOR, linewidth=0.6)
    axes.set_axisbelow(True)


@contextmanager
def plain_texts() -> Iterator[None]:
    """Inside, a dollar sign in a name is a dollar sign and no formula, and an unknown letter a box and no warning."""
    import matplotlib as mpl

    with mpl.rc_context({"text.parse_math": False, "font.size": 9}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def png_of(figure: Any) -> bytes:
    """The figure as a PNG file; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def use_log(axes: Any, axis: Literal["x", "y"]) -> None:
    """A logarithmic axis with plain numbers at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(**{f"{axis}scale": "log"})
    chosen = axes.xaxis if axis == "x" else axes.yaxis
    chosen.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    chosen.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:g}"))
    chosen.set_minor_formatter(NullFormatter())


def place_labels(figure: Any, axes: Any, labels: Sequence[str], points: Sequence[tuple[float, float]]) -> None:
    """Each label next to its mark where it covers no other label or mark, as far as such a place is found."""
    figure.draw_without_rendering()  # the layout has to be known
    marks = axes.transData.transform(points)
    taken: list[Any] = []
    for i, (label, point) in enumerate(zip(labels, points, strict=True)):
        paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.5}
        text = axes.annotate(
            label, point, xytext=(0, 0), textcoords="offset points", fontsize=7.5, bbox=paper, zorder=2.5
        )
        costs = []
        for offset in _LABEL_OFFSETS:
            _move(text, offset)
            box = text.get_window_extent()
            n_covered = sum(box.overlaps(other) for other in taken)
            n_covered += sum(bool(box.contains(x, y)) for j, (x, y) in enumerate(marks) if j != i)
            outside = max(axes.bbox.x0 - box.x0, box.x1 - axes.bbox.x1, axes.bbox.y0 - box.y0, box.y1 - axes.bbox.y1)
            costs.append((n_covered, max(outside, 0.0)))
        _move(text, _LABEL_OFFSETS[costs.index(min(costs))])
        taken.append(text.get_window_extent())


def _move(text: Any, offset: tuple[int, int]) -> None:
    text.set_position(offset)
    text.set_horizontalalignment("left" if offset[0] > 0 else "right" if offset[0] < 0 else "center")
