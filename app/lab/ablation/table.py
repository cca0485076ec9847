"""The table of an ablation: one line per variant, means and spread over seeds, as text, CSV and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.csv_text import csv_text
from app.lab.flicker import definition_of
from app.lab.paper_tables import ANOTHER_CAPTURE, FIGURES, OWN_FIGURES

COLUMNS: dict[str, tuple[str, int]] = {
    "psnr": ("PSNR", 2),
    "cc_psnr": ("cc PSNR", 2),
    "psnr_fit": ("PSNR fit", 2),
    "psnr_moving": ("moving", 2),
    "psnr_rest": ("static", 2),
    "ssim": ("SSIM", 4),
    "dssim1": ("DSSIM1", 4),
    "dssim_ms": ("DSSIM MS", 4),
    "dssim_range2": ("DSSIM r2", 4),
    "lpips": ("LPIPS", 4),
    "flip": ("FLIP", 4),
    "flicker_inside": ("flicker inside /255", 3),
    "flicker_borders": ("flicker borders /255", 3),
    "seam_ratio_static": ("seam ratio static", 3),
    "seam_ratio_moving": ("seam ratio moving", 3),
    "tof": ("tOF px", 3),
    "tof_inside": ("tOF inside px", 3),
    "tof_borders": ("tOF borders px", 3),
    "later_psnr": ("later PSNR", 2),
    "later_psnr_moving": ("later moving", 2),
    "later_s": ("s per later clip", 0),
    "minutes": ("minutes", 1),
    "megabytes": ("MB", 2),
    "mb_per_frame": ("MB per frame", 3),
    "fps_cpu": ("FPS CPU", 1),
    "fps_gl": ("FPS GL", 1),
    "n_gaussians": ("Gaussians", 0),
}
"""Figure to its heading and decimals. Held-out cameras, raw colours unless the name says fit. PSNR in dB. "later" ones
are means over the clips that inherit, their time that of preparation and training."""
DEFINITION = definition_of('the borders are those of the clips of "full" for every line')
"""Definition of flicker and seam ratios."""


@dataclass(frozen=True, slots=True)
class VariantResult:
    """Figures of one variant trained with one seed; None where one does not exist. n_frames: measured, per camera."""

    variant: str
    seed: int
    figures: dict[str, float | None]
    n_frames: int | None = None


def summarize(results: Sequence[VariantResult]) -> list[dict[str, Any]]:
    """One line per variant: n_seeds, n_frames, and per figure its mean and standard deviation over seeds."""
    lines = []
    for name in dict.fromkeys(result.variant for result in results):
        of_name = [result for result in results if result.variant == name]
        line: dict[str, Any] = {"variant": name, "n_seeds": len(of_name), "n_frames": of_name[0].n_frames}
        for figure in COLUMNS:
            values = [v for result in of_name if (v := result.figures.get(figure)) is not None and math.isfinite(v)]
            line[figure] = float(np.mean(values)) if values else None
            line[f"{figure}_std"] = float(np.std(values, ddof=1)) if len(values) > 1 else None
        lines.append(line)
    return lines


def as_text(lines: Sequence[dict[str, Any]]) -> str:
    """The table for a terminal; figures that no line has are left out."""
    shown = [name for name in COLUMNS if any(line[name] is not None for line in lines)]
    width = max((len(line["variant"]) for line in lines), default=0)
    has_frames = any(line["n_frames"] is not None for line in lines)
    rows = [["", *(["frames"] if has_frames else []), *(COLUMNS[name][0] for name in shown)]]
    for line in lines:
        cells = [line["variant"].ljust(width)]
        if has_frames:
            cells.append("-" if line["n_frames"] is None else str(line["n_frames"]))
        for name in shown:
            value, spread, decimals = line[name], line[f"{name}_std"], COLUMNS[name][1]
            text = "-" if value is None else f"{value:.{decimals}f}"
            cells.append(text if spread is None else f"{text} ±{spread:.{decimals}f}")
        rows.append(cells)
    return _aligned(rows)


def paper_text(rows: Sequence[dict[str, Any]]) -> str:
    """Rows of `beside_ablations` for a terminal; empty without any. Figures that no variant has are left out."""
    if not rows:
        return ""
    cells = [["", "row of the paper"], *([row["variant"], row["paper_row"]] for row in rows)]
    for column, names in OWN_FIGURES.items():
        measured = [(name, *COLUMNS[name]) for name in names if any(row[name] is not None for row in rows)]
        printed = [(f"paper_{column}", "paper", FIGURES[column].n_digits)] if measured else []
        for name, title, decimals in measured + printed:
            cells[0].append(title)
            for line, row in zip(cells[1:], rows, strict=True):
                line.append("-" if row[name] is None else f"{row[name]:.{decimals}f}")
    return f"{_aligned(cells)}\n{ANOTHER_CAPTURE}"


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(cell.rjust(w) if i else cell.ljust(w) for i, (cell, w) in enumerate(
        zip(row, widths, strict=True))) for row in rows)  # fmt: skip


def as_csv(lines: Sequence[dict[str, Any]]) -> str:
    """The table with full precision."""
    names = ["variant", "n_seeds", "n_frames", *(part for name in COLUMNS for part in (name, f"{name}_std"))]
    return csv_text(names, [{name: line.get(name) for name in names} for line in lines])
