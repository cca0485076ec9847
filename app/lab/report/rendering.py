"""The section on how fast trained clips are rendered, of every project of the page."""

from __future__ import annotations

from collections.abc import Sequence

from app.evaluation.speed.frame_rates import DEFINITION
from app.lab.report.comparison import Compared
from app.lab.report.page.parts import Section
from app.lab.report.page.tables import Table, TableColumn

_COLUMNS = (
    TableColumn("project", "Project"),
    TableColumn("size", "Picture", unit="px"),
    TableColumn("camera", "Camera"),
    TableColumn("by", "By"),
    TableColumn("fps", "FPS", 1),
    TableColumn("fps_drawing", "FPS, drawing alone", 1),
    TableColumn("n_gaussians", "Gaussians drawn"),
    TableColumn("n_laps", "Pictures"),
    TableColumn("why_missing", "Why there is none"),
)


def rendering_section(compared: Sequence[Compared]) -> Section | None:
    """Frames per second with their conditions: size, Gaussians and back end. None where nothing was measured."""
    rows = []
    for one in compared:
        if one.rates is None:
            continue
        rates = one.rates
        shared = {"project": one.facts.name, "size": rates.size, "camera": rates.camera}
        for rate, words in ((rates.cpu, "CPU rasterizer"), (rates.gl, "OpenGL")):
            row = shared | {"by": words} | dict.fromkeys(("fps", "fps_drawing", "n_gaussians", "n_laps"))
            if rate is not None:
                row |= {"by": rate.drawn_by, "fps": rate.fps, "fps_drawing": rate.fps_drawing}
                row |= {"n_gaussians": rate.n_gaussians, "n_laps": rate.n_laps, "why_missing": ""}
            else:
                row["why_missing"] = rates.why_no_gl if words == "OpenGL" else "the clock stood still"
            rows.append(row)
    if not rows:
        return None
    said = (
        f"{DEFINITION} The rasterizer leaves out anchors that the camera cannot see, as eval and render do; the window "
        "decodes and draws all of the clip. Measured on the machine that wrote this page, under any load it had then."
    )
    return Section("rendering", "Rendering", [said, Table("rendering", "Pictures per second", _COLUMNS, rows)])
