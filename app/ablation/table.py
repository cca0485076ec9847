"""The table of an ablation: one line per variant, means and spread over seeds, as text, CSV and JSON."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

COLUMNS: dict[str, tuple[str, int]] = {
    "psnr": ("PSNR", 2),
    "psnr_fit": ("PSNR fit", 2),
    "psnr_moving": ("moving", 2),
    "psnr_rest": ("static", 2),
    "ssim": ("SSIM", 4),
    "dssim1": ("DSSIM1", 4),
    "dssim_ms": ("DSSIM MS", 4),
    "dssim_range2": ("DSSIM r2", 4),
    "lpips": ("LPIPS", 4),
    "flip": ("FLIP", 4),
    "seam_ratio_static": ("seam static", 3),
    "seam_ratio_moving": ("seam moving", 3),
    "seam_change_static": ("flicker /255", 3),
    "minutes": ("minutes", 1),
    "megabytes": ("MB", 2),
}
"""Figure to its heading and decimals. Held-out cameras, raw colours unless the name says fit. PSNR in dB; seam: change
of the render at clip borders / inside clips; flicker: mean change of static pixels from frame to frame."""


@dataclass(frozen=True, slots=True)
class VariantResult:
    """Figures of one variant trained with one seed; None where a figure does not exist."""

    variant: str
    seed: int
    figures: dict[str, float | None]


def seam_figures(rows: Sequence[dict[str, Any]], borders: set[int]) -> dict[str, float | None]:
    """Change of held-out renders at the given border frames against all other frames.

    The borders are those of "full" for every variant, so that one that has no clips there can be compared.

    Args:
        rows: PairRow.as_dict.
        borders: Frames at which a clip of "full" starts.
    """
    held_out = [row for row in rows if row["is_held_out"]] or list(rows)

    def mean(name: str, *, is_border: bool) -> float | None:
        values = [row[name] for row in held_out if (row["frame_index"] in borders) == is_border]
        values = [value for value in values if value is not None]
        return float(np.mean(values)) if values else None

    figures: dict[str, float | None] = {}
    for part in ("static", "moving"):
        at, inside = (mean(f"change_{part}", is_border=is_border) for is_border in (True, False))
        figures[f"seam_ratio_{part}"] = None if at is None or not inside else at / inside
    inside = mean("change_static", is_border=False)
    figures["seam_change_static"] = None if inside is None else 255.0 * inside
    return figures


def summarize(results: Sequence[VariantResult]) -> list[dict[str, Any]]:
    """One line per variant: n seeds, and per figure its mean and standard deviation over seeds."""
    lines = []
    for name in dict.fromkeys(result.variant for result in results):
        of_name = [result for result in results if result.variant == name]
        line: dict[str, Any] = {"variant": name, "n_seeds": len(of_name)}
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
    rows = [["", *(COLUMNS[name][0] for name in shown)]]
    for line in lines:
        cells = [line["variant"].ljust(width)]
        for name in shown:
            value, spread, decimals = line[name], line[f"{name}_std"], COLUMNS[name][1]
            text = "-" if value is None else f"{value:.{decimals}f}"
            cells.append(text if spread is None else f"{text} ±{spread:.{decimals}f}")
        rows.append(cells)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join("  ".join(cell.rjust(w) if i else cell.ljust(w) for i, (cell, w) in enumerate(
        zip(row, widths, strict=True))) for row in rows)  # fmt: skip


def as_csv(lines: Sequence[dict[str, Any]]) -> str:
    """The table with full precision."""
    names = ["variant", "n_seeds", *(part for name in COLUMNS for part in (name, f"{name}_std"))]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()
