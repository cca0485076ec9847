"""Presets: named sets of training settings, from a toy to the published sizes. Data, no behaviour.

"small" is the default of every setting. The others change sizes; what follows from the data (levels, table entries,
steps) stays derived unless the published method fixes it.
Source: ClipGStream and its released configurations; sizes below "paper" are ours.
"""

from __future__ import annotations

from typing import Any

from engine.errors import ProjectError

PRESETS: dict[str, dict[str, Any]] = {
    "toy": {
        "gaussians_per_anchor": 4,
        "field_hidden": 32,
        "head_hidden": 32,
        "max_static_points": 4_000,
        "max_moving_points": 6_000,
        "passes": 4,
    },
    "small": {},
    "medium": {
        "static_feature_dim": 32,
        "dynamic_feature_dim": 32,
        "max_static_points": 40_000,
        "max_moving_points": 60_000,
        "field_max_levels": 8,
        "passes": 16,
    },
    # 64 + 64 features, ten Gaussians, 16 levels of 4 values that double in resolution, 2^17 entries, 34 passes over
    # the pictures, every anchor at every time. Heads are 2 F wide (the published offset head 4 F).
    "paper": {
        "static_feature_dim": 64,
        "dynamic_feature_dim": 64,
        "gaussians_per_anchor": 10,
        "head_hidden": 256,
        "field_hidden": 128,
        "field_base_cells": 16,
        "field_growth": 2.0,
        "field_levels": 16,
        "field_log2_entries": 17,
        "passes": 34,
        "gate": "off",
    },
}
"""Name to the settings in which a preset differs from the defaults."""


def preset(name: str) -> dict[str, Any]:
    """Settings of a preset, a copy. Raises ProjectError for an unknown name."""
    if name not in PRESETS:
        raise ProjectError(f"There is no preset called '{name}'.", hint=f"Presets are {', '.join(PRESETS)}.")
    return dict(PRESETS[name])
