"""Parts of the section on speed against error: quality over each clip's own training, and formats of exports."""

from __future__ import annotations

from collections.abc import Sequence

from app.lab.bench.rows import Trade
from app.lab.report.charts import SpeedPanel, draw_speed_error, draw_training
from app.lab.report.page.parts import Figure, Part
from app.lab.report.page.tables import Table, TableColumn
from app.project.clips.metrics_file import read_metrics
from app.project.project_facts import ProjectFacts
from app.training.curves import is_number

MAX_CURVES = 14
"""Clips whose trainings are drawn, from the first; more lines could not be distinguished."""


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
