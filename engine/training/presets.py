"""Presets: named sets of training settings, from a toy to the published sizes. Data, no behaviour.

"small" is the default of every setting. "toy" and "medium" change sizes, "paper" also rates and weights; values that
follow from the data (levels, table entries, steps) stay derived unless the published method fixes them. "paper-..." are
"paper" with what the released configuration of a data set changes.
Source: ClipGStream and its released configurations; "toy", "small" and "medium" are ours.
"""

from __future__ import annotations

from typing import Any

from engine.errors import ProjectError

PUBLISHED_SIZES: dict[str, Any] = {
    "static_feature_dim": 64,
    "dynamic_feature_dim": 64,
    "gaussians_per_anchor": 10,
    "head_hidden": 256,
    "field_hidden": 128,
    "field_base_cells": 16,
    "field_growth": 2.0,
    "field_levels": 16,
    "field_log2_entries": 17,
}
"""Sizes of the model that do not depend on the capture."""

PAPER: dict[str, Any] = PUBLISHED_SIZES | {
    "max_static_points": 1_000_000,
    "max_moving_points": 1_000_000,
    "cloud": "frames",
    "backgrounds": "clip",
    "initial": "published",
    "field_form": "published",
    "color": "off",
    "passes": 34,
    # opacity and shape heads start as in every preset
    "feature_lr": 7.5e-3,
    "scale_lr": 7e-3,
    "position_lr": 1.6e-4,
    "position_final_ratio": 0.01,
    "table_lr": 2e-4,
    "field_mlp_lr": 2e-4,
    "color_head_lr": 8e-3,
    "offset_head_lr": 8e-3,
    "feature_final_ratio": 1.0,
    "scale_final_ratio": 1.0,
    "field_final_ratio": 0.01,
    "opacity_head_final_ratio": 0.01,
    "shape_head_final_ratio": 1.0,
    "color_head_final_ratio": 0.00625,
    "offset_head_final_ratio": 0.00625,
    "volume": "sum",
    "volume_weight": 0.01,
    "max_gradient_norm": 0.0,
    "inherit": "frozen",
    "decoder": "frozen",
    "field_tables": "shared",
    "gate": "off",
    "motion": "stay",
    "tiles": "all",
    "storage": "exact",
}
"""The published method: the paper where it speaks, the released code where it does not, with the table size that this
has by default. Known differences are listed, with reasons, in docs/method.md."""

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
    "paper": PAPER,
    "paper-long360": PAPER | {"field_log2_entries": 20},
    "paper-vru": PAPER | {"field_log2_entries": 19},
}
"""Name to the settings in which a preset differs from the defaults."""


def preset(name: str) -> dict[str, Any]:
    """Settings of a preset, a copy. Raises ProjectError for an unknown name."""
    if name not in PRESETS:
        raise ProjectError(f"There is no preset called '{name}'.", hint=f"Presets are {', '.join(PRESETS)}.")
    return dict(PRESETS[name])


def closest_preset(overrides: dict[str, Any]) -> str:
    """The preset with the most settings among those that hold all of its own."""
    fitting = [name for name, values in PRESETS.items() if values.items() <= overrides.items()]
    return max(fitting, key=lambda name: len(PRESETS[name]))
