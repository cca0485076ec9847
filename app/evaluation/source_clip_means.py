"""Cost and quality of one more clip: means over the clips of a project that inherit from its reference."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

LATER_PSNR, LATER_MOVING, LATER_S = "later_psnr", "later_psnr_moving", "later_s"


def later_figures(means: Mapping[str, Any], group: str, seconds: Mapping[int, float | None]) -> dict[str, float | None]:
    """PSNR in dB and seconds of a clip, averaged; None where there is no such clip or one of them has no figure.

    Args:
        means: Of an evaluation, per clip (its index as text) and group of cameras.
        group: held_out or trained_on.
        seconds: Preparation and training of each clip that inherits, None where not recorded.
    """
    rows = [means.get(str(index), {}).get(group) or {} for index in seconds]
    figures: dict[str, list[float | None]] = {
        LATER_PSNR: [row.get("psnr") for row in rows],
        LATER_MOVING: [row.get("psnr_moving") for row in rows],
        LATER_S: list(seconds.values()),
    }
    return {name: _mean(values) for name, values in figures.items()}


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
