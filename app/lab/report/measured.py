"""Sections on measurements: figures per clip, error over time, worst frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

from app.lab.pictures import Pictures
from app.lab.report.charts import ChartLine, CurvePanel, draw_over_time, draw_pictures
from app.lab.report.comparison import main_group
from app.lab.report.page.labels import FIGURE_LABELS, figure_label
from app.lab.report.page.parts import Figure, Folded, Section
from app.lab.report.page.tables import Table, TableColumn
from engine.metrics.columns import COLUMNS

GROUP_WORDS = {"held_out": "held out", "trained_on": "trained on"}
_DIRECTIONS = {True: "higher", False: "lower", None: ""}
ERROR_RANGE = (0.0, 0.25)
"""Colour range of error pictures, the same in every report; colours lie in 0..1."""
N_PICTURES = 6
MAX_CLIP_COLUMNS = 10
"""Clips up to which a table has columns for each of them; those of more are in files only."""
MAX_NAMED_BORDERS = 12
Tick = Callable[[], None]


def clips_section(evaluation: dict[str, Any]) -> Section:
    """Every column of every clip, held-out and trained-on cameras apart."""
    means, described = evaluation["means"], measured_columns(evaluation)
    groups = [group for group in GROUP_WORDS if means.get(group)]
    parts = [("all", means), *((clip, means["clips"][clip]) for clip in means["clips"])]
    has_few = len(means["clips"]) <= MAX_CLIP_COLUMNS
    columns = [
        TableColumn("figure", "Figure", labels=FIGURE_LABELS),
        TableColumn("unit", "Unit"),
        TableColumn("better", "Better"),
    ]
    columns += [
        TableColumn(
            f"{name}_{group}",
            f"{'All clips' if name == 'all' else f'Clip {name}'}, {GROUP_WORDS[group]}",
            is_shown=name == "all" or has_few,
        )
        for name, _ in parts
        for group in groups
    ]
    columns += [TableColumn("why_missing", "Why a value is missing")]
    rows = [
        {
            "figure": name,
            "unit": column["unit"],
            "better": _DIRECTIONS[column["is_higher_better"]],
            **{f"{part}_{group}": found[group].get(name) for part, found in parts for group in groups},
            "why_missing": missing_text(column),
        }
        for name, column in described.items()
    ]
    meaning = [
        {
            "figure": name,
            "definition": column["definition"],
            "n_rows": column["n_rows"],
            "n_missing": column["n_missing"],
        }
        for name, column in described.items()
    ]
    meaning_columns = (
        TableColumn("figure", "Figure", labels=FIGURE_LABELS),
        TableColumn("definition", "Definition"),
        TableColumn("n_rows", "Pictures with it"),
        TableColumn("n_missing", "Pictures without"),
    )
    said = (
        f"Means over {len(evaluation['rows'])} pictures: every frame of every camera. Figures are of raw colours, or "
        "after the colour fit, a least-squares gain and offset per channel. A mean leaves out pictures without the "
        "figure."
    )
    n_left_out = len(evaluation["columns"]) - len(described)
    if n_left_out:
        said += f" {n_left_out} figures that take longer were not asked for; --metrics all measures them too."
    if not has_few:
        said += f" Those of each of the {len(means['clips'])} clips are in tables/clip_metrics.csv."
    table = Table("clip_metrics", "Figures per clip", columns, rows)
    definitions = Table("columns", "Columns", meaning_columns, meaning)
    rows_table = _rows_table("pictures", "Every picture that was measured", evaluation["rows"])
    parts_shown = [said, table, Folded("Definitions of the figures", definitions), _cameras(evaluation), rows_table]
    return Section("clips", "Figures per clip", parts_shown)


def measured_columns(evaluation: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Columns of an evaluation without those that were not asked for."""
    is_quick = evaluation["metrics"] == "quick"
    return {
        name: column
        for name, column in evaluation["columns"].items()
        if not (is_quick and name in COLUMNS and not COLUMNS[name].is_quick)
    }


def missing_text(column: dict[str, Any]) -> str:
    """Why rows have no value in a column, with the number of rows; empty when all have one."""
    return "; ".join(f"{reason} ({n} pictures)" for reason, n in column["why_missing"].items())


def _cameras(evaluation: dict[str, Any]) -> Folded:
    shown = ("psnr", "cc_psnr", "psnr_fit", "psnr_moving", "psnr_rest", "ssim", "flip")
    described = measured_columns(evaluation)
    columns = [TableColumn("camera", "Camera"), TableColumn("is_held_out", "Held out")]
    columns += [
        TableColumn(name, figure_label(name), unit="dB" if described[name]["unit"] == "dB" else "")
        for name in shown
        if name in described
    ]
    rows = [
        {"camera": camera, **{column.key: found.get(column.key) for column in columns[1:]}}
        for camera, found in evaluation["means"]["cameras"].items()
    ]
    return Folded("Figures per camera", Table("cameras", "Means of each camera over all clips", columns, rows))


def _rows_table(name: str, caption: str, rows: Sequence[dict[str, Any]]) -> Table:
    """All rows as they are, for files only."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    filled = [{key: row.get(key) for key in keys} for row in rows]
    return Table(name, caption, [TableColumn(key, key) for key in keys], filled, is_shown=False)


def time_section(evaluation: dict[str, Any]) -> Section:
    """PSNR of each frame, with the borders of the clips."""
    frames = evaluation["means"]["frames"]
    numbers, borders = frames["frame_index"], clip_borders(frames)
    group = main_group(evaluation)
    cameras = list(dict.fromkeys(row["camera"] for row in evaluation["rows"] if row["is_held_out"]))
    found = {(row["camera"], row["frame_index"]): row for row in evaluation["rows"]}

    def panel(name: str, label: str) -> CurvePanel:
        curves = [ChartLine(c, [found.get((c, f), {}).get(name) for f in numbers]) for c in cameras]
        for part in (group, *(other for other in GROUP_WORDS if other != group)):
            if frames.get(part):
                words = f"mean, {GROUP_WORDS[part]}"
                curves.append(ChartLine(words, frames[part][name], is_main=part == group))
        return CurvePanel(label, curves)

    panels = [panel("psnr", "PSNR, dB"), panel("psnr_moving", "PSNR, moving pixels, dB")]
    if len(borders) == 0:
        border_words = "There is one clip, so no border."
    elif len(borders) > MAX_NAMED_BORDERS:
        border_words = f"{len(borders)} clips begin, one after each dashed line."
    else:
        border_words = f"Clips begin at frame {', '.join(map(str, borders))}, after each dashed line."
    chart = Figure(
        "error_over_time",
        draw_over_time(panels, numbers, borders),
        f"PSNR of each frame, raw colours: held-out cameras and means of both kinds. {border_words}",
        f"Curves of PSNR over frames {numbers[0]} to {numbers[-1]}, all pixels above, moving pixels below. "
        f"{border_words}",
    )
    names = [key for key in frames if key in GROUP_WORDS and frames[key]]
    columns = [TableColumn("frame_index", "Frame"), TableColumn("clip_index", "Clip")]
    columns += [TableColumn(f"{key}_{group}", key) for group in names for key in frames[group]]
    rows = [
        {
            "frame_index": number,
            "clip_index": frames["clip_index"][i],
            **{f"{key}_{group}": frames[group][key][i] for group in names for key in frames[group]},
        }
        for i, number in enumerate(numbers)
    ]
    table = Table("frames", "Means of each frame", columns, rows, is_shown=False)
    return Section("time", "Error over time", [chart, table])


def clip_borders(frames: dict[str, Any]) -> list[int]:
    """First frames of all clips but the first, of the frames entry of an evaluation's means."""
    pairs = list(zip(frames["frame_index"], frames["clip_index"], strict=True))
    return [frame for (_, before), (frame, clip) in pairwise(pairs) if clip != before]


# ---------------------------------------------------------------- worst frames


def worst_pictures(evaluation: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Which pictures to show: (figure it is worst in, row). Cameras of the main group, at most one per clip and camera
    and figure, since frames next to a bad one look the same."""
    is_held_out = main_group(evaluation) == "held_out"
    rows = [row for row in evaluation["rows"] if row["is_held_out"] == is_held_out]
    chosen: dict[tuple[str, int], tuple[str, dict[str, Any]]] = {}
    for name, limit in (("psnr", N_PICTURES - 2), ("psnr_moving", N_PICTURES)):
        seen = set()
        for row in sorted((row for row in rows if row[name] is not None), key=lambda row: row[name]):
            place = (row["clip_index"], row["camera"])
            if len(chosen) < limit and place not in seen:
                seen.add(place)
                chosen.setdefault((row["camera"], row["frame_index"]), (name, row))
    return list(chosen.values())


def worst_section(evaluation: dict[str, Any], pictures: Pictures, tick: Tick) -> Section:
    """The worst frames as pictures and as lists."""
    group = main_group(evaluation)
    parts: list[Any] = [
        f"Cameras {GROUP_WORDS[group]}. Of each clip and camera the worst frame, the worst first; the error is drawn "
        f"from {ERROR_RANGE[0]:g} to {ERROR_RANGE[1]:g} in every picture."
    ]
    for number, (name, row) in enumerate(worst_pictures(evaluation), start=1):
        truth, image = pictures.pair(row["clip_index"], row["frame_index"], row["camera"])
        words = "PSNR" if name == "psnr" else "PSNR of moving pixels"
        what = f"Camera {row['camera']}, frame {row['frame_index']}, clip {row['clip_index']}"
        caption = f"{what}: worst in {words}, {row[name]:.2f} dB."
        alt = f"Truth, render and error side by side. {caption}"
        parts.append(Figure(f"worst_{number:02d}", draw_pictures(truth, image, ERROR_RANGE), caption, alt))
        tick()
    for name, listed in evaluation["means"]["worst"][group].items():
        if listed:
            columns = (
                TableColumn("camera", "Camera"),
                TableColumn("frame_index", "Frame"),
                TableColumn("clip_index", "Clip"),
                TableColumn(name, name),
            )
            table = Table(f"worst_{name}", f"Worst frames by {name}", columns, listed)
            parts.append(Folded(f"The {len(listed)} worst frames by {name}", table))
    return Section("worst", "Worst frames", parts)
