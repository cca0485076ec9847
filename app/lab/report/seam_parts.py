"""The section on seams: changes at clip boundaries that are not in the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.lab.pictures import Pictures
from app.lab.report.charts import ChartLine, CurvePanel, MapPanel, draw_maps, draw_over_time
from app.lab.report.measured import GROUP_WORDS, Tick, clip_borders
from app.lab.report.page.parts import Figure, Folded, Part, Section
from app.lab.report.page.tables import Table, TableColumn
from engine.metrics.clips.seams import MAP_RANGE
from engine.metrics.clips.summary import mean_of

N_BOUNDARIES = 6
"""Boundaries with maps; of more, those with the worst score are shown."""
_GROUPS = {"all": "all", **GROUP_WORDS}
_RATIOS = ("ratio_static", "ratio_moving", "truth_ratio_moving")
_PARTS = ("static", "moving")
_LETTERS = {"change": "R", "truth_change": "G", "excess": "E"}


def seams_section(evaluation: dict[str, Any], pictures: Pictures, tick: Tick) -> Section:
    """Scores and ratios of every boundary, maps of its worst camera, and normal values inside the clips."""
    seams = evaluation["seams"]
    parts: list[Any] = []
    if not seams["boundaries"]:
        parts.append("No two neighbouring clips are trained, so there is no boundary to measure.")
    else:
        parts += [
            "R is the change of the render from one frame to the next, G that of the truth, E = max(R - G, 0). The "
            "score is E on static pixels at the boundary minus its normal value inside the two clips; 0: no seam. "
            "A ratio is mean R at the boundary / mean R inside; 1: no seam. Moving pixels may move more at a boundary "
            "than elsewhere; the ratio of the truth shows by how much.",
            _boundaries(seams),
            *_two_clips(seams["rows"]),
        ]
    if seams["rows"]:
        parts += [_over_time(evaluation), _normal(seams)]
    chosen = shown_boundaries(seams)
    if len(chosen) < len(seams["boundaries"]):
        parts.append(f"Maps of the {len(chosen)} worst of {len(seams['boundaries'])} boundaries.")
    for boundary in chosen:
        parts.append(_maps(boundary, pictures))
        tick()
    if seams["boundaries"]:
        parts.append(_by_camera(seams))
    parts += [
        Folded(
            "Definitions",
            Table(
                "seam_definitions",
                "Definitions of the seam figures",
                (TableColumn("name", "Name"), TableColumn("definition", "Definition")),
                [{"name": name, "definition": words} for name, words in seams["definitions"].items()],
            ),
        )
    ]
    if seams["rows"]:
        columns = [TableColumn(key, key) for key in seams["rows"][0]]
        caption = "Every pair of neighbouring frames, colours in 0..1"
        parts.append(Table("seam_pairs", caption, columns, seams["rows"], is_shown=False))
    return Section("seams", "Seams", parts)


def shown_boundaries(seams: dict[str, Any]) -> list[dict[str, Any]]:
    """Boundaries to draw maps of, in order of time: those with a worst camera, the worst scores if there are many."""
    known = [boundary for boundary in seams["boundaries"] if boundary["worst_camera"] is not None]
    worst = sorted(known, key=lambda boundary: -(boundary["score"] or 0.0))[:N_BOUNDARIES]
    return sorted(worst, key=lambda boundary: boundary["frame_index"])


def _boundaries(seams: dict[str, Any]) -> Table:
    columns = [TableColumn("frame_index", "First frame"), TableColumn("clips", "Clips")]
    columns += [TableColumn(f"score_{g}", f"Score, {words}", 3, unit="1/255") for g, words in _GROUPS.items()]
    titles = ("Ratio, static", "Ratio, moving", "Ratio of the truth, moving")
    columns += [
        TableColumn(f"{name}_{g}", f"{title}, {words}", 2)
        for name, title in zip(_RATIOS, titles, strict=True)
        for g, words in _GROUPS.items()
    ]
    columns += [TableColumn("worst_camera", "Worst camera"), TableColumn("worst_score", "Its score", 3, unit="1/255")]
    rows = []
    for boundary in seams["boundaries"]:
        groups = {"all": boundary, **{group: boundary[group] for group in GROUP_WORDS}}
        worst = boundary["worst_camera"]
        rows.append(
            {
                "frame_index": boundary["frame_index"],
                "clips": " to ".join(str(clip) for clip in boundary["clips"]),
                **{f"{name}_{g}": found.get(name) for name in ("score", *_RATIOS) for g, found in groups.items()},
                "worst_camera": worst,
                "worst_score": None if worst is None else boundary["cameras"][worst]["score"],
            }
        )
    return Table("seams", "Every clip boundary", columns, rows)


def _two_clips(rows: Sequence[dict[str, Any]]) -> list[Part]:
    """Two clips at one instant, at borders where the clip before can show anything but its last frame."""
    borders = [row for row in rows if row["is_boundary"]]
    frames = sorted({row["frame_index"] for row in borders if not row["is_held"]})
    n_held = len({row["frame_index"] for row in borders if row["is_held"]})
    held = (
        f"At {n_held} of the borders the field of the clip before ends with its last frame and gives that one for "
        "the first frame of the next clip too, so the two clips differ by R there at one instant."
    )
    if not frames:
        return [held] if n_held else []
    columns = [TableColumn("frame_index", "First frame"), TableColumn("n_pairs", "Cameras")]
    columns += [
        TableColumn(f"{name}_{part}", f"{title}, {part}", 3, unit="1/255")
        for name, title in (("two_clips", "Two clips"), ("change", "R"))
        for part in _PARTS
    ]
    table = []
    for frame in frames:
        found = [row for row in borders if row["frame_index"] == frame and not row["is_held"]]
        means = {column.key: mean_of([row[column.key] for row in found]) for column in columns[2:]}
        levels = {key: None if value is None else 255.0 * value for key, value in means.items()}
        table.append({"frame_index": frame, "n_pairs": len(found), **levels})
    caption = "One instant by two clips: the clip before, asked beyond its end, against the first frame of the next"
    return [Table("two_clips", caption, columns, table), *([held] if n_held else [])]


def _normal(seams: dict[str, Any]) -> Table:
    columns = [TableColumn("pairs", "Neighbouring frames"), TableColumn("cameras", "Cameras")]
    columns += [TableColumn("n_pairs", "Pairs")]
    columns += [
        TableColumn(f"{what}_{part}", f"{letter}, {part}", 3, unit="1/255")
        for part in _PARTS
        for what, letter in _LETTERS.items()
    ]
    columns += [TableColumn("static_share", "Share of static pixels", 3), TableColumn("tof", "tOF", 3, unit="px")]
    rows = []
    for place, words in (("boundary", "at a boundary"), ("interior", "inside a clip")):
        for group, group_words in _GROUPS.items():
            found = seams["means"][group][place]
            levels = {f"{what}_{part}": found[f"{what}_{part}"] for part in _PARTS for what in _LETTERS}
            if found["n_pairs"]:
                rows.append(
                    {
                        "pairs": words,
                        "cameras": group_words,
                        "n_pairs": found["n_pairs"],
                        **{key: None if value is None else 255.0 * value for key, value in levels.items()},
                        "static_share": found["static_share"],
                        "tof": found.get("tof"),
                    }
                )
    return Table("seam_means", "Static and moving pixels apart, at boundaries and inside clips", columns, rows)


def _by_camera(seams: dict[str, Any]) -> Folded:
    names = ("score", *_RATIOS)
    columns = [TableColumn("frame_index", "First frame"), TableColumn("camera", "Camera")]
    columns += [TableColumn("is_held_out", "Held out"), TableColumn("score", "Score", 3, unit="1/255")]
    columns += [TableColumn(name, name.replace("_", " "), 2) for name in _RATIOS]
    rows = [
        {
            "frame_index": boundary["frame_index"],
            "camera": camera,
            "is_held_out": found["is_held_out"],
            **{name: found[name] for name in names},
        }
        for boundary in seams["boundaries"]
        for camera, found in boundary["cameras"].items()
    ]
    return Folded("Seams per camera", Table("seam_cameras", "Every boundary in every camera", columns, rows))


def _over_time(evaluation: dict[str, Any]) -> Figure:
    rows = evaluation["seams"]["rows"]
    frames = sorted({row["frame_index"] for row in rows})
    by_frame = {frame: [row for row in rows if row["frame_index"] == frame] for frame in frames}

    def mean(name: str) -> list[float | None]:
        values = [[row[name] for row in by_frame[frame] if row[name] is not None] for frame in frames]
        return [255.0 * float(np.mean(found)) if found else None for found in values]

    panels = [
        CurvePanel(
            f"{part} pixels, 1/255",
            [
                ChartLine("E, excess", mean(f"excess_{part}"), is_main=True),
                ChartLine("R, render", mean(f"change_{part}")),
                ChartLine("G, truth", mean(f"truth_change_{part}")),
            ],
        )
        for part in _PARTS
    ]
    borders = clip_borders(evaluation["means"]["frames"])
    return Figure(
        "seam_over_time",
        draw_over_time(panels, frames, borders),
        "Change from one frame to the next, mean over all cameras. A seam is a peak of E at a dashed line.",
        "Curves of R, G and E over frames, static pixels above and moving ones below, with clip borders",
    )


def _maps(boundary: dict[str, Any], pictures: Pictures) -> Figure:
    camera, clips, frame = boundary["worst_camera"], boundary["clips"], boundary["frame_index"]
    maps = pictures.changes(frame, camera)
    panels = [
        MapPanel("R: change of the render", maps.change),
        MapPanel("G: change of the truth", maps.truth_change),
        MapPanel("E, static pixels", maps.excess, maps.is_static),
        MapPanel("E, moving pixels", maps.excess, ~maps.is_static),
    ]
    score = boundary["cameras"][camera]["score"]
    caption = (
        f"Frame {frame}, between clips {clips[0]} and {clips[1]}, camera {camera} with the worst score there, "
        f"{score:.2f}/255. Drawn from {MAP_RANGE[0]:g} to {MAP_RANGE[1]:g} in every map; grey pixels belong to the "
        "other part."
    )
    alt = f"Four maps side by side: R, G, E on static and E on moving pixels. {caption}"
    return Figure(f"seam_{frame:06d}", draw_maps(panels, MAP_RANGE, "colours in 0..1"), caption, alt)
