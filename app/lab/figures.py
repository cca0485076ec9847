"""The common parts of all charts: palette, an off-screen figure, PNG bytes. Imports matplotlib only when one is made:
importing it takes longer than most commands."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette: distinguished with any colour vision."""
FAINT_COLOR, GRID_COLOR = "#555555", "#DDDDDD"
DPI = 110


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
