"""Seconds per stage and memory of a training, as its metrics rows and clip files keep them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def stages_of(row: Mapping[str, Any]) -> dict[str, float]:
    """The stages_s of a document or metrics row; empty where there are none or they are not numbers."""
    found = row.get("stages_s")
    if not isinstance(found, dict):
        return {}
    return {
        str(stage): float(seconds)
        for stage, seconds in found.items()
        if isinstance(seconds, int | float) and math.isfinite(seconds) and seconds >= 0
    }


def memory_of(row: Mapping[str, Any]) -> float:
    """The memory_mb of a metrics row; 0 where there is none or it is not a number."""
    held = row.get("memory_mb")
    return float(held) if isinstance(held, int | float) and math.isfinite(held) and held >= 0 else 0.0
