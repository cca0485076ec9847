"""The page that `clipgstream ablate --report` writes: all variants of one seed side by side, below the table of all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.evaluation.speed.frame_rates import RatesOf
from app.lab.ablation.running import project_folder
from app.lab.ablation.table import COLUMNS
from app.lab.ablation.variants import FULL
from app.lab.report.page.parts import Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.write import OnStage, write_report

if TYPE_CHECKING:
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

REPORT = "report"
"""Folder of the page, in that of the ablation."""


def write_ablation_report(
    folder: Path,
    document: dict[str, Any],
    *,
    seed: int,
    metrics: Choice,
    precision: Precision,
    on_stage: OnStage,
    say: Callable[[str], None],
    rates_of: RatesOf,
) -> Path:
    """Compare all variants in a folder that were trained with one seed with "full"; the page begins with the table.

    Args:
        document: The result of `run_ablation`.
        seed: Of the projects that are shown; other seeds are in the table only.
        metrics, precision, on_stage, say, rates_of: See app.lab.report.write.write_report.
    Returns:
        The page.
    Raises:
        ProjectError, CaptureError: See there.
    """
    names = [result["variant"] for result in document["results"] if result["seed"] == seed]
    return write_report(
        project_folder(folder, FULL, seed),
        compare=[project_folder(folder, name, seed) for name in names if name != FULL],
        out=folder / REPORT,
        metrics=metrics,
        precision=precision,
        beginning=[ablation_section(document, seed)],
        on_stage=on_stage,
        say=say,
        rates_of=rates_of,
    )


def ablation_section(document: dict[str, Any], seed: int) -> Section:
    """The table of an ablation: means over the seeds, and how far they are spread."""
    lines: Sequence[dict[str, Any]] = document["lines"]
    keys = [key for name in COLUMNS for key in (name, f"{name}_std") if any(line[key] is not None for line in lines)]
    columns = [
        TableColumn("variant", "Variant"),
        TableColumn("words", "Description"),
        TableColumn("n_seeds", "Seeds"),
        TableColumn("n_frames", "Frames"),
        *(_column(key) for key in keys),
    ]
    rows = [
        {"variant": line["variant"], "words": document["words"].get(line["variant"], "")}
        | {key: line[key] for key in ("n_seeds", "n_frames", *keys)}
        for line in lines
    ]
    n_seeds = len(document["seeds"])
    said = "Means over the seeds; ± is the standard deviation over them. " if n_seeds > 1 else ""
    said += f"All pictures below are of the projects of seed {seed}."
    parts = [said, Table("ablation", "Variants", columns, rows), document["definition"]]
    if document["rendering"] is not None:
        parts.append(document["rendering"]["words"])
    return Section("ablation", "Ablation", parts)


def _column(key: str) -> TableColumn:
    name = key.removesuffix("_std")
    title, n_digits = COLUMNS[name]
    return TableColumn(key, title if name == key else f"± {title}", n_digits)
