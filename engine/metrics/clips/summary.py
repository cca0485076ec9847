"""Rows of an evaluation brought together: means, curves over time, worst frames, and missing figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.metrics.columns import COLUMNS

WORST_BY = ("psnr", "psnr_moving", "flip")
"""Figures by which worst frames are listed."""
N_WORST = 10
GROUPS = ("held_out", "trained_on")


@dataclass(frozen=True, slots=True)
class EvalRow:
    """One rendered picture against its truth.

    Attributes:
        clip_index, frame_index, camera: Which picture; camera is its name.
        is_held_out: Whether the camera was kept from training.
        figures: Every column of engine.metrics.columns by name; None where the figure does not exist.
        missing: The reason for each None.
    """

    clip_index: int
    frame_index: int
    camera: str
    is_held_out: bool
    figures: dict[str, float | None]
    missing: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """JSON-able, figures next to the rest; reasons are left to `columns_of`."""
        which = {name: getattr(self, name) for name in ("clip_index", "frame_index", "camera", "is_held_out")}
        return which | self.figures


def means(rows: Sequence[EvalRow]) -> dict[str, float | None]:
    """Mean of every column over the rows that have it; None where none has, {} without rows."""
    if not rows:
        return {}
    return {name: mean_of([row.figures[name] for row in rows]) for name in rows[0].figures}


def mean_of(values: Sequence[float | None]) -> float | None:
    """Mean of the values that exist, or None."""
    found = [value for value in values if value is not None]
    return float(np.mean(found)) if found else None


def by_group(rows: Sequence[EvalRow]) -> dict[str, dict[str, float | None]]:
    """Means of held-out cameras and of those trained on."""
    return {group: means(_of_group(rows, group)) for group in GROUPS}


def by_camera(rows: Sequence[EvalRow]) -> dict[str, dict[str, Any]]:
    """Means of each camera, with is_held_out."""
    parts = _parted(rows, lambda row: row.camera)
    return {str(name): {"is_held_out": part[0].is_held_out, **means(part)} for name, part in parts.items()}


def by_frame(rows: Sequence[EvalRow]) -> dict[str, Any]:
    """Every figure over time, column by column: a mean over the cameras of a group for each frame.

    Returns:
        frame_index and clip_index, one entry per frame in rising order, and per group {column: list as long}.
    """
    parts = _parted(sorted(rows, key=lambda row: row.frame_index), lambda row: row.frame_index)
    found: dict[str, Any] = {
        "frame_index": list(parts),
        "clip_index": [part[0].clip_index for part in parts.values()],
    }
    for group in GROUPS:
        frames = [means(_of_group(part, group)) for part in parts.values()]
        found[group] = {name: [frame.get(name) for frame in frames] for name in COLUMNS} if any(frames) else {}
    return found


def worst(rows: Sequence[EvalRow], name: str, *, n_worst: int = N_WORST) -> list[dict[str, Any]]:
    """The rows with the worst figure in a column, worst first; rows without the figure cannot be ranked."""
    sign = 1.0 if COLUMNS[name].is_higher_better else -1.0
    ranked = sorted(
        ((sign * value, row) for row in rows if (value := row.figures[name]) is not None),
        key=lambda item: (item[0], item[1].frame_index, item[1].camera),
    )
    return [
        {"clip_index": row.clip_index, "frame_index": row.frame_index, "camera": row.camera, name: row.figures[name]}
        for _, row in ranked[:n_worst]
    ]


def worst_by_group(rows: Sequence[EvalRow]) -> dict[str, dict[str, list[dict[str, Any]]]]:
    """`worst` for each figure of WORST_BY and each group of cameras."""
    return {group: {name: worst(_of_group(rows, group), name) for name in WORST_BY} for group in GROUPS}


def columns_of(rows: Sequence[EvalRow]) -> dict[str, dict[str, Any]]:
    """The meaning of each column, how many rows have it, and how many have not for which reason."""
    found = {}
    for name, column in COLUMNS.items():
        reasons = Counter(row.missing[name] for row in rows if name in row.missing)
        found[name] = {
            "definition": column.definition,
            "unit": column.unit,
            "is_higher_better": column.is_higher_better,
            "n_rows": len(rows) - reasons.total(),
            "n_missing": reasons.total(),
            "why_missing": dict(reasons),
        }
    return found


def _of_group(rows: Sequence[EvalRow], group: str) -> list[EvalRow]:
    return [row for row in rows if row.is_held_out == (group == "held_out")]


def _parted(rows: Sequence[EvalRow], key: Callable[[EvalRow], Any]) -> dict[Any, list[EvalRow]]:
    parts: dict[Any, list[EvalRow]] = {}
    for row in rows:
        parts.setdefault(key(row), []).append(row)
    return parts
