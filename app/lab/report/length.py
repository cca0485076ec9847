"""The section on length: quality, seams, time and memory of each clip over the sequence, so that drift shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.lab.report.charts import ChartLine, CurvePanel, draw_over_time
from app.lab.report.comparison import main_group
from app.lab.report.measured import GROUP_WORDS
from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.project.project_facts import ClipFacts
from engine.metrics.clips.summary import mean_of

MIN_LATER_CLIPS = 6
"""Clips that inherit from which on early and late ones are compared: a third is two clips then."""
_PSNR = {"psnr": "all pixels", "psnr_moving": "moving pixels", "psnr_rest": "pixels that do not move"}
_SEAM = {"seam_score": "score", "seam_ratio_static": "ratio_static", "seam_ratio_moving": "ratio_moving"}
_COMPARED = (
    ("psnr", "PSNR", "dB", 2),
    ("psnr_moving", "PSNR of moving pixels", "dB", 2),
    ("seam_score", "seam score", "of 255", 3),
    ("wall_s", "time", "s", 1),
    ("memory_mb", "memory", "MB", 0),
)
"""Figures of early and late clips: column, name, unit and digits."""


def length_section(evaluation: dict[str, Any], clips: Sequence[ClipFacts]) -> Section:
    """Figures of every trained clip over the sequence, as charts and one table.

    Args:
        evaluation: Its rows, means and seams.
        clips: Those that were measured, in order.
    """
    group = main_group(evaluation)
    rows = _rows(evaluation, clips, group)
    parts: list[Any] = [
        f"PSNR and seams of the {GROUP_WORDS[group].replace(' ', '-')} cameras, raw colours. A seam is that to the "
        "clip before, where both are trained. Memory is the most that the process held which prepared and trained the "
        "clip. The mean so far is over all pictures of the clips up to this one: the figure of a capture that ends "
        "there."
    ]
    if len(rows) > 1:
        parts += [_quality_chart(rows), *_seam_charts(rows), *_cost_charts(rows)]
        parts.append(_early_and_late(rows, clips))
    columns = (
        TableColumn("clip_index", "Clip"),
        TableColumn("frames", "Frames"),
        TableColumn("psnr", "PSNR", 2, unit="dB"),
        TableColumn("psnr_moving", "PSNR, moving", 2, unit="dB"),
        TableColumn("psnr_rest", "PSNR, rest", 2, unit="dB"),
        TableColumn("psnr_so_far", "PSNR, mean so far", 2, unit="dB"),
        TableColumn("seam_score", "Seam score", 3, unit="1/255"),
        TableColumn("seam_ratio_static", "Seam ratio, static", 2),
        TableColumn("seam_ratio_moving", "Seam ratio, moving", 2),
        TableColumn("preparation_s", "Preparation", 1, unit="s"),
        TableColumn("training_s", "Training", 1, unit="s"),
        TableColumn("wall_s", "Both", 1, unit="s"),
        TableColumn("memory_mb", "Memory", 0, unit="MB"),
    )
    parts.append(Table("length", "Each clip over the sequence", columns, rows))
    return Section("length", "Length", parts)


def _rows(evaluation: Mapping[str, Any], clips: Sequence[ClipFacts], group: str) -> list[dict[str, Any]]:
    means = evaluation["means"]["clips"]
    seams = {boundary["clips"][1]: boundary[group] for boundary in evaluation["seams"]["boundaries"]}
    pictures = _psnr_by_clip(evaluation, group)
    rows, total, n = [], 0.0, 0
    for clip in clips:
        found, seam = means[str(clip.clip_index)][group], seams.get(clip.clip_index, {})
        psnr = pictures.get(clip.clip_index, ())
        total, n = total + sum(psnr), n + len(psnr)
        rows.append(
            {
                "clip_index": clip.clip_index,
                "frames": f"{clip.start} to {clip.start + clip.n_frames - 1}",
                **{name: found.get(name) for name in _PSNR},
                "psnr_so_far": total / n if n else None,
                **{name: seam.get(source) for name, source in _SEAM.items()},
                "preparation_s": None if clip.preparation_s is None else clip.preparation_s - clip.compiling_s,
                "training_s": clip.training_s,
                "wall_s": clip.wall_s,
                "memory_mb": clip.memory_mb,
            }
        )
    return rows


def _psnr_by_clip(evaluation: Mapping[str, Any], group: str) -> dict[int, list[float]]:
    """PSNR of the pictures of each clip that have one."""
    found: dict[int, list[float]] = {}
    for row in evaluation["rows"]:
        if row["is_held_out"] == (group == "held_out") and row["psnr"] is not None:
            found.setdefault(row["clip_index"], []).append(row["psnr"])
    return found


def _quality_chart(rows: Sequence[dict[str, Any]]) -> Figure:
    quality = [ChartLine(words, _column(rows, name), is_main=name == "psnr") for name, words in _PSNR.items()]
    panels = [
        CurvePanel("PSNR, dB", quality),
        CurvePanel("mean so far, dB", [ChartLine("clips up to this one", _column(rows, "psnr_so_far"), is_main=True)]),
    ]
    return _chart(
        "length_quality",
        rows,
        panels,
        "PSNR of each clip, and the mean over the sequence up to it. Clips that are not trained are left out.",
    )


def _seam_charts(rows: Sequence[dict[str, Any]]) -> list[Figure]:
    if not any(row["seam_score"] is not None or row["seam_ratio_static"] is not None for row in rows):
        return []
    ratios = [
        ChartLine("static pixels", _column(rows, "seam_ratio_static")),
        ChartLine("moving pixels", _column(rows, "seam_ratio_moving")),
    ]
    panels = [
        CurvePanel("seam score, 1/255", [ChartLine("static pixels", _column(rows, "seam_score"), is_main=True)]),
        CurvePanel("seam ratio", ratios),
    ]
    caption = "The seam at the beginning of each clip. A score of 0 and a ratio of 1: no seam."
    return [_chart("length_seams", rows, panels, caption)]


def _cost_charts(rows: Sequence[dict[str, Any]]) -> list[Figure]:
    panels = []
    if any(row["wall_s"] is not None for row in rows):
        seconds = [
            ChartLine("both", _column(rows, "wall_s"), is_main=True),
            ChartLine("preparation", _column(rows, "preparation_s")),
            ChartLine("training", _column(rows, "training_s")),
        ]
        panels.append(CurvePanel("seconds", seconds))
    if any(row["memory_mb"] is not None for row in rows):
        panels.append(CurvePanel("memory, MB", [ChartLine("most held", _column(rows, "memory_mb"), is_main=True)]))
    if not panels:
        return []
    caption = "Time and memory of each clip on the machine that trained it, kernels compiled before."
    return [_chart("length_costs", rows, panels, caption)]


def _chart(name: str, rows: Sequence[dict[str, Any]], panels: Sequence[CurvePanel], caption: str) -> Figure:
    numbers = [row["clip_index"] for row in rows]
    alt = f"Curves over clips {numbers[0]} to {numbers[-1]}: {'; '.join(panel.label for panel in panels)}"
    return Figure(name, draw_over_time(panels, numbers, (), "clip"), caption, alt)


def _column(rows: Sequence[dict[str, Any]], name: str) -> list[float | None]:
    return [row[name] for row in rows]


def _early_and_late(rows: Sequence[dict[str, Any]], clips: Sequence[ClipFacts]) -> str:
    """One sentence on whether later clips are worse, slower or larger than early ones."""
    later = [row for row, clip in zip(rows, clips, strict=True) if clip.role == "source"]
    if len(later) < MIN_LATER_CLIPS:
        return f"Early and late clips are compared from {MIN_LATER_CLIPS} clips that inherit on."
    n = len(later) // 3
    said = []
    for name, words, unit, digits in _COMPARED:
        early, late = (mean_of(_column(part, name)) for part in (later[:n], later[-n:]))
        if early is not None and late is not None:
            said.append(f"{words} {early:.{digits}f}, then {late:.{digits}f} {unit}")
    return f"Means of the first {n} clips that inherit, then of the last {n}: {'; '.join(said)}."
