"""The section with changes across a boundary in every project, at the same place and under one colour range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.paper_figures.by_hand import Places, borders_of
from app.lab.report.paper_figures.drawing import ChangeColumn, draw_change_maps
from app.lab.report.paper_figures.pictured import Pictured, of_main_group, trained_on
from engine.metrics.clips.seams import MAP_RANGE, SeamMaps
from engine.metrics.clips.summary import mean_of

_PARTS = ("static", "moving")
_KINDS = ("change", "excess")
_STATIC = tuple(f"{kind}_static" for kind in _KINDS)
_INSIDE = "inside clip"


def change_maps_section(projects: Sequence[Pictured], places: Places, left_out: Sequence[str]) -> Section:
    """R and E of every project across one boundary, next to the capture's own change.

    Args:
        projects: The page's own first.
        left_out: Sentences on projects that are in no picture.
    """
    title = "Changes across a boundary"
    place = chosen_boundary(projects, places)
    if place is None:
        return Section("change_maps", title, ["No two neighbouring clips are trained, so no boundary is shown."])
    frame, camera = place
    shown, missing = trained_on(projects, (frame - 1, frame))
    if not shown:
        return Section("change_maps", title, [*missing, *left_out])
    maps = [one.pictures.changes(frame, camera) for one in shown]
    first = shown[0].clip_at(frame)
    assert first is not None
    truth, _ = shown[0].pictures.pair(first.clip_index, frame, camera)
    rows = [_row(one, frame, found) for one, found in zip(shown, maps, strict=True)]
    capture_row = _capture_row(maps[0])
    columns = [
        ChangeColumn(row["project"], *_said(row), found.change, found.excess)
        for row, found in zip(rows, maps, strict=True)
    ]
    chosen = "chosen by hand" if places.boundary is not None and places.camera is not None else _rule(places)
    caption = (
        f"Frame {frame - 1} to frame {frame}, camera {camera}: {chosen}. R is the change of the render, G that of "
        "the capture, E = max(R - G, 0), each a mean over the channels. All maps are drawn from "
        f"{MAP_RANGE[0]:g} to {MAP_RANGE[1]:g}; the number above a map is its mean over pixels that stand still in the "
        "capture, in 1/255."
    )
    names = ", ".join(one.name for one in shown)
    figure = Figure(
        "change_maps",
        draw_change_maps(maps[0].truth_change, _said(capture_row)[0], truth, columns, MAP_RANGE),
        caption,
        f"Maps of R above and E below: the capture, then {names}. {caption}",
    )
    table_columns = (
        TableColumn("project", "Project"),
        TableColumn("clips", "Clips"),
        *(
            TableColumn(f"{kind}_{part}", f"{'R' if kind == 'change' else 'E'}, {part}", 3, unit="1/255")
            for part in _PARTS
            for kind in _KINDS
        ),
    )
    table = Table(
        "change_maps", f"Means of the maps, camera {camera}, frame {frame}", table_columns, [capture_row, *rows]
    )
    return Section("change_maps", title, [figure, table, *missing, *left_out])


def chosen_boundary(projects: Sequence[Pictured], places: Places) -> tuple[int, str] | None:
    """First frame after a boundary and a camera: as wished, else by `_rule`; None where no clips meet.

    Boundaries are those of the first project, of any where it has none. A mean is over the projects that have a figure
    there; where there is none at all it is the first boundary and camera.
    """
    borders = borders_of(projects[0].compared.facts)
    borders = borders or sorted({frame for one in projects for frame in borders_of(one.compared.facts)})
    if places.boundary is not None:
        borders = [places.boundary]
    if not borders:
        return None
    first = projects[0].compared
    pairs = first.evaluation["seams"]["rows"]
    cameras = list(dict.fromkeys(row["camera"] for row in of_main_group(first, pairs)))
    if places.camera is not None:
        cameras = [places.camera]
    excess = [
        {(row["frame_index"], row["camera"]): row["excess_static"] for row in one.compared.evaluation["seams"]["rows"]}
        for one in projects
    ]
    means = {
        (frame, camera): mean_of([found.get((frame, camera)) for found in excess])
        for frame in borders
        for camera in cameras
    }
    return max(means, key=lambda place: -1.0 if (mean := means[place]) is None else mean, default=None)


def _rule(places: Places) -> str:
    if places.boundary is not None:
        return "the boundary was chosen by hand, the camera is the one with the largest mean E on static pixels there"
    if places.camera is not None:
        return "the camera was chosen by hand, the boundary is the one with the largest mean E on static pixels"
    return "where E on static pixels, the mean over all projects, is largest among the cameras that are measured"


def _row(one: Pictured, frame: int, maps: SeamMaps) -> dict[str, Any]:
    before, after = one.clip_at(frame - 1), one.clip_at(frame)
    assert before is not None
    assert after is not None
    meet = before.clip_index != after.clip_index
    clips = f"{before.clip_index} to {after.clip_index}" if meet else f"{_INSIDE} {after.clip_index}"
    return {"project": one.name, "clips": clips} | _levels(
        change=maps.means(maps.change), excess=maps.means(maps.excess)
    )


def _capture_row(maps: SeamMaps) -> dict[str, Any]:
    levels = _levels(change=maps.means(maps.truth_change), excess=(None, None))
    return {"project": "capture (G)", "clips": ""} | levels


def _levels(**means: tuple[float | None, float | None]) -> dict[str, float | None]:
    return {
        f"{kind}_{part}": None if value is None else 255.0 * value
        for kind, values in means.items()
        for part, value in zip(_PARTS, values, strict=True)
    }


def _said(row: dict[str, Any]) -> tuple[str, str]:
    """Means on static pixels, for the titles of R (or G) and E; whether no clips meet here."""
    change, excess = ("" if row[name] is None else f"{row[name]:.2f}/255" for name in _STATIC)
    return f"{change}, {row['clips']}" if row["clips"].startswith(_INSIDE) else change, excess
