"""Sections with the paper's own tables next to the projects of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

from app.lab.paper_tables import (
    ANOTHER_CAPTURE,
    FIGURES,
    OWN_FIGURES,
    PaperRow,
    PaperTable,
    beside_ablations,
    tables_like,
)
from app.lab.report.beside_published import is_alike
from app.lab.report.comparison import Compared
from app.lab.report.page.labels import figure_label
from app.lab.report.page.parts import Section
from app.lab.report.page.tables import Table, TableColumn


def paper_ablations_section(compared: Sequence[Compared]) -> Section | None:
    """The paper's ablation tables next to projects in folders that `clipgstream ablate` has named; None where fewer
    than two of these stand for a row."""
    names = [name for of_column in OWN_FIGURES.values() for name in of_column]
    lines = [
        {"variant": PurePath(one.facts.name).name.rpartition("-seed")[0], **{name: one.figure(name) for name in names}}
        for one in compared
    ]
    rows = beside_ablations(lines)
    if not rows:
        return None
    columns = [
        TableColumn("variant", "Variant"),
        TableColumn("paper_row", "Row of the paper"),
        TableColumn("tables", "Table"),
    ]
    for column, names in OWN_FIGURES.items():
        figure = FIGURES[column]
        columns += [
            TableColumn(name, figure_label(name), 2 if name == "psnr" else 4, unit=figure.unit) for name in names
        ]
        columns.append(TableColumn(f"paper_{column}", f"Paper: {figure.title}", figure.n_digits, unit=figure.unit))
    table = Table("paper_ablations", "Held out here; another capture in the paper", columns, rows)
    return Section("paper_ablations", "Next to the paper's ablations", [ANOTHER_CAPTURE, table])


def paper_tables_section(compared: Sequence[Compared], capture: Mapping[str, Any]) -> Section | None:
    """Tables 1 to 4 with the page's projects above their rows; None where the capture is like none of the paper's.

    Args:
        compared: The page's own project first.
        capture: Of the first, see engine.capture.capture_summary.describe.
    """
    sizes = {(camera["width"], camera["height"]) for camera in capture["cameras"]}
    tables = tables_like(capture["format"], capture["n_cameras"], sizes, Path(capture["path"]))
    if not tables:
        return None
    alike = [one for one in compared if is_alike(one, compared[0])]
    said = (
        "By its layout, cameras, sizes and name this capture may be one of the paper's; whether frames, held-out "
        "cameras and scale are the same as well is for the reader to check. Definitions differ, see docs/method.md."
    )
    return Section("paper_tables", "Next to the paper's tables", [said, *(_table(table, alike) for table in tables)])


def _table(table: PaperTable, compared: Sequence[Compared]) -> Table:
    own = [name for column in table.columns if column == "dssim2" for name in OWN_FIGURES[column]]
    columns = [
        TableColumn("method", "Method"),
        TableColumn("family", "Family"),
        *(
            TableColumn(column, FIGURES[column].title, FIGURES[column].n_digits, unit=FIGURES[column].unit)
            for column in table.columns
        ),
        *(TableColumn(name, figure_label(name), 4) for name in own),
        TableColumn("note", "Note"),
    ]
    rows = [*(_own(one, table, own) for one in compared), *(_printed(table, row, own) for row in table.rows)]
    return Table(f"paper_table_{table.number}", f"Table {table.number}: {table.capture.title}", columns, rows)


def _own(one: Compared, table: PaperTable, own: Sequence[str]) -> dict[str, Any]:
    costs = {"hours": one.minutes and one.minutes / 60.0, "megabytes": one.megabytes, "fps": one.frame_rates["fps_gl"]}
    n_frames = sum(clip.n_frames for clip in one.facts.clips)
    return {
        "method": f"This project: {one.facts.name}",
        "family": "",
        **{column: costs[column] if column in costs else one.figure(column) for column in table.columns},
        **{name: one.figure(name) for name in own},
        "note": f"measured here, {n_frames} frames",
    }


def _printed(table: PaperTable, row: PaperRow, own: Sequence[str]) -> dict[str, Any]:
    more = [f"{FIGURES[column].title.lower()}: more than that" for column in row.lower_bounds]
    named = {"method": row.method, "family": row.family, "note": "; ".join(["printed", *more])}
    return named | table.figures(row) | dict.fromkeys(own)
