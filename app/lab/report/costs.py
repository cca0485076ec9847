"""The costs of a project: bytes of its clip files, seconds of its stages, and both against quality."""

from __future__ import annotations

from collections.abc import Sequence

from app.background.kernels import COMPILING
from app.lab.bench.rows import Trade
from app.lab.report.charts import SpeedPanel, draw_speed_error, draw_stacked, draw_training
from app.lab.report.measured import MAX_CLIP_COLUMNS
from app.lab.report.page.parts import Figure, Part, Section
from app.lab.report.page.tables import Table, TableColumn
from app.project.clips.clip_bytes import COMPONENT_NAMES
from app.project.clips.metrics_file import read_metrics
from app.project.project_facts import ProjectFacts
from app.spans import spans_text
from app.training.curves import is_number
from app.training.worker.stage_watch import KEEPING, TRAINING

MAX_CURVES = 14
"""Clips whose trainings are drawn, from the first; more lines could not be distinguished."""


def storage_section(facts: ProjectFacts) -> Section:
    """Where the bytes of the clip files go."""
    columns = (
        TableColumn("clip", "Clip"),
        TableColumn("role", "Role"),
        *(TableColumn(_key(name, "bytes"), name.capitalize(), unit="bytes") for name in COMPONENT_NAMES),
        TableColumn("total_bytes", "Total", unit="bytes"),
    )
    rows = [
        {
            "clip": str(clip.clip_index),
            "role": clip.role,
            **{_key(name, "bytes"): clip.storage[name] for name in COMPONENT_NAMES},
            "total_bytes": sum(clip.storage.values()),
        }
        for clip in facts.clips
    ]
    total = {
        column.key: sum(int(row[column.key]) for row in rows) for column in columns if column.key.endswith("bytes")
    }
    rows.append({"clip": "all", "role": "", **total})
    n_frames = sum(clip.n_frames for clip in facts.clips)
    said = f"{facts.n_bytes / 1e6:.1f} MB for {n_frames} frames, {facts.n_bytes / 1e6 / n_frames:.2f} MB per frame."
    chart = Figure(
        "storage",
        draw_stacked(
            {name: [clip.storage[name] / 1e6 for clip in facts.clips] for name in COMPONENT_NAMES},
            [f"clip {clip.clip_index}" for clip in facts.clips],
            "megabytes",
        ),
        "Bytes of each clip file by component. A source clip stores its own parts, not the inherited ones.",
        f"Stacked bars of {len(facts.clips)} clip files by component; {said}",
    )
    return Section("storage", "Storage", [said, chart, Table("storage", "Bytes per component", columns, rows)])


def times_section(facts: ProjectFacts) -> Section:
    """Steps and seconds of each clip."""
    stages = list(dict.fromkeys(stage for clip in facts.clips for stage in clip.stages_s))
    stages = [stage for stage in stages if stage not in (TRAINING, KEEPING)] + [
        stage for stage in (TRAINING, KEEPING) if stage in stages
    ]
    columns = (
        TableColumn("clip", "Clip"),
        TableColumn("steps", "Steps"),
        TableColumn("steps_per_s", "Steps per second", 1),
        TableColumn("preparation_s", "Preparation", 1, unit="s"),
        TableColumn("training_s", "Training", 1, unit="s"),
        TableColumn("compiling_s", "Compiling kernels", 1, unit="s"),
        TableColumn("wall_s", "Counted", 1, unit="s"),
    )
    rows = []
    for clip in facts.clips:
        compiling_s = None if clip.wall_s is None else clip.compiling_s
        rows.append(
            {
                "clip": str(clip.clip_index),
                "steps": clip.n_steps,
                "steps_per_s": clip.n_steps / clip.training_s if clip.training_s else None,
                "preparation_s": None
                if clip.preparation_s is None or compiling_s is None
                else clip.preparation_s - compiling_s,
                "training_s": clip.training_s,
                "compiling_s": compiling_s,
                "wall_s": clip.wall_s,
            }
        )
    parts: list = [
        "Wall time, pauses left out. Kernels are compiled once on every machine, so that time is not counted; "
        "preparation includes the work with which a step begins a new phase."
    ]
    unknown = [clip.clip_index for clip in facts.clips if clip.wall_s is None]
    if unknown:
        parts.append(f"Not recorded when it was trained: clip {spans_text(unknown)}.")
    if stages:
        chart = draw_stacked(
            {stage: [clip.stages_s.get(stage, 0.0) for clip in facts.clips] for stage in stages if stage != COMPILING},
            [f"clip {clip.clip_index}" for clip in facts.clips],
            "seconds",
        )
        alt = f"Stacked bars of the seconds of {len(facts.clips)} clips in {len(stages)} stages"
        parts.append(Figure("times", chart, "Seconds of each stage.", alt))
    parts.append(Table("times", "Steps and wall time per clip", columns, rows))
    if stages:
        stage_columns = [TableColumn("stage", "Stage")]
        stage_columns += [
            TableColumn(f"clip_{clip.clip_index}_s", f"Clip {clip.clip_index}", 1, unit="s") for clip in facts.clips
        ]
        stage_rows = [
            {"stage": stage, **{f"clip_{clip.clip_index}_s": clip.stages_s.get(stage) for clip in facts.clips}}
            for stage in stages
        ]
        is_shown = len(facts.clips) <= MAX_CLIP_COLUMNS
        parts.append(Table("stages", "Seconds per stage", stage_columns, stage_rows, is_shown=is_shown))
    return Section("times", "Times", parts)


def training_parts(facts: ProjectFacts) -> list[Part]:
    """PSNR of held-out pictures over the time of each clip. Nothing where no such times were recorded."""
    curves = {}
    for clip in facts.clips[:MAX_CURVES]:
        rows = read_metrics(facts.project.metrics_path(clip.clip_index))
        points = [(row.get("training_s"), row.get("held_out_psnr")) for row in rows]
        known = [(x, y) for x, y in points if is_number(x) and is_number(y)]
        if known:
            curves[f"clip {clip.clip_index}"] = known
    if not curves:
        return []
    chart = draw_training(curves, "training, seconds", "PSNR of some held-out pictures, dB")
    caption = "Quality over the training of each clip, without its preparation, measured on a few held-out pictures."
    alt = f"PSNR over the seconds of {len(curves)} trainings"
    return [Figure("training_curves", chart, caption, alt)]


def export_parts(trades: Sequence[Trade]) -> list[Part]:
    """Formats of exported Gaussians: time and size of a file against its error. Nothing where none was measured."""
    if not trades:
        return []
    names, label = [trade.setting for trade in trades], "writing the first frame, ms"
    times_ms, psnrs = [trade.seconds * 1e3 for trade in trades], [trade.psnr_db for trade in trades]
    sizes_mb = [trade.n_bytes / 1e6 for trade in trades]
    panels = (SpeedPanel("PSNR against the live picture, dB", psnrs, True), SpeedPanel("file, MB", sizes_mb, False))
    chart = draw_speed_error(names, times_ms, panels, None, label)
    caption = "Formats of exported Gaussians. The file is read again and drawn; the worst of three cameras counts."
    columns = (
        TableColumn("mark", "Mark"),
        TableColumn("format", "Format"),
        TableColumn("write_ms", "Writing", 1, False, "ms"),
        TableColumn("psnr_db", "PSNR", 1, True, "dB"),
        TableColumn("megabytes", "Size", 2, False, "MB"),
    )
    rows = [
        {"mark": mark, "format": name, "write_ms": ms, "psnr_db": psnr, "megabytes": size}
        for mark, (name, ms, psnr, size) in enumerate(zip(names, times_ms, psnrs, sizes_mb, strict=True), start=1)
    ]
    alt = f"PSNR and size of {len(names)} formats against the time to write one frame"
    return [Figure("exports", chart, caption, alt), Table("exports", "Formats of exports", columns, rows)]


def _key(name: str, unit: str) -> str:
    return f"{name.replace(' ', '_')}_{unit}"
