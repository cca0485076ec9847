"""Quality over time of variants whose source clips were trained with several numbers of steps.

Every point is a separate training whose rates fall to their end, not a point along a longer one. Two variants are
compared at equal PSNR: the best that both reach; times in between are interpolated on the logarithm of time along the
best values that a curve has reached so far.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from app.evaluation.source_clip_means import LATER_MOVING, LATER_PSNR, LATER_S
from app.lab.ablation.variants import FULL, variant_called

FIGURES = {LATER_PSNR: "PSNR", LATER_MOVING: "PSNR of moving pixels"}
"""Figures to set against time, and their names."""

Points = Sequence[tuple[float, float]]


def curves_of(lines: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Curves of all variants with at least two points, "full" first. JSON-able.

    Args:
        lines: Of the table.
    Returns:
        Per variant: `variant`, `points` (each with source_steps, later_s and FIGURES, rising in steps) and, except for
        "full", `at_equal`: per figure the PSNR, `seconds`, `seconds_full`, `ratio`, and `is_least` where "full" is
        already better at its first point, so that the ratio is at least that. None where the curves do not meet, or
        where the other one is already better at its first point: how much earlier it was as good is unknown.
    """
    found: dict[str, list[dict[str, Any]]] = {}
    for line in lines:
        variant = variant_called(line["variant"])
        if variant is not None and variant.base_name and line.get(LATER_S):
            point = {"source_steps": variant.overrides["source_steps"], LATER_S: line[LATER_S]}
            found.setdefault(variant.base_name, []).append(point | {name: line.get(name) for name in FIGURES})
    curves = [{"variant": name, "points": points} for name, points in found.items() if len(points) > 1]
    full = next((curve["points"] for curve in curves if curve["variant"] == FULL), None)
    for curve in curves:
        if full is not None and curve["variant"] != FULL:
            curve["at_equal"] = {name: _at_equal(_pairs(full, name), _pairs(curve["points"], name)) for name in FIGURES}
    return curves


def curve_lines(curves: Sequence[dict[str, Any]]) -> list[str]:
    """Comparisons at equal PSNR as sentences."""
    said = []
    for curve in curves:
        for name, equal in curve.get("at_equal", {}).items():
            if equal is None:
                continue
            least = "at least " if equal["is_least"] else ""
            said.append(
                f"{curve['variant']}: {FIGURES[name]} of {equal['psnr']:.2f} dB after {equal['seconds']:.0f} s a clip, "
                f"{FULL} after {'at most ' if least else ''}{equal['seconds_full']:.0f} s: {least}"
                f"{equal['ratio']:.1f} times as long"
            )
    return said


def seconds_to(points: Points, psnr: float) -> float | None:
    """When a curve reaches a PSNR; its first time where it begins above, None where it never does.

    Args:
        points: (seconds, PSNR).
    """
    reached: list[tuple[float, float]] = []
    for seconds, value in sorted(points):
        if not reached or value > reached[-1][1]:
            reached.append((seconds, value))
    for index, (seconds, value) in enumerate(reached):
        if value >= psnr:
            if index == 0:
                return seconds
            before_s, before = reached[index - 1]
            share = (psnr - before) / (value - before)
            return before_s * (seconds / before_s) ** share
    return None


def _pairs(points: Sequence[dict[str, Any]], name: str) -> list[tuple[float, float]]:
    known = [(point[LATER_S], point[name]) for point in points]
    return [(seconds, value) for seconds, value in known if value is not None and math.isfinite(value)]


def _at_equal(full: Points, other: Points) -> dict[str, Any] | None:
    if not full or not other:
        return None
    psnr = min(max(value for _, value in full), max(value for _, value in other))
    if min(other)[1] > psnr:
        return None
    seconds, seconds_full = seconds_to(other, psnr), seconds_to(full, psnr)
    if seconds is None or seconds_full is None:
        return None
    return {
        "psnr": psnr,
        "seconds": seconds,
        "seconds_full": seconds_full,
        "ratio": seconds / seconds_full,
        "is_least": min(full)[1] > psnr,
    }
