"""The field of a clip: a fresh one that fits the anchors alive in it."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from engine.clip_files.clip_header import FieldShape
from engine.errors import PreparationError
from engine.model.clip_model import ClipModel
from engine.model.field import SpatioTemporalField
from engine.model.field_sizes import derive_cells, derive_log2_entries, derive_strides
from engine.training.config import TrainConfig

_MOST_LOG2 = 20
"""log2 of the most table entries where every anchor is in the field, so that each has as many as with the gate."""


def fit_field(
    model: ClipModel,
    *,
    spacing: float,
    config: TrainConfig,
    generator: torch.Generator,
    around: Tensor | None = None,
) -> str:
    """Attach a fresh field over the dynamic anchors alive in this clip; none when nothing moves. Says its size.

    Args:
        spacing: Distance between moving anchors, scene units.
        around: Further positions that its box has to hold. [n, 3]
    Raises:
        PreparationError: Its tables would be too large.
    """
    positions, most_alive = _alive_positions(model), n_alive(model)
    if len(positions) == 0:
        return "no field: nothing moves in this clip"
    is_published, is_shared = config.field_form == "published", config.field_tables != "per_frame"
    # percentiles, so that one stray point does not stretch the grid; beyond them positions clamp to the border
    ends = (0.0, 1.0) if is_published else (0.005, 0.995)
    lower, upper = (positions.quantile(end, dim=0) for end in ends)
    if around is not None:
        lower = torch.minimum(lower, around.quantile(ends[0], dim=0))
        upper = torch.maximum(upper, around.quantile(ends[1], dim=0))
    margin = 0.0 if is_published else spacing
    side = max(float((upper - lower).max()), 4 * spacing) + 2 * margin
    n_levels = config.field_levels or config.field_max_levels
    n_shared = model.n_frames if is_shared else 1
    most = {"at_most": _MOST_LOG2} if config.gate == "off" else {}
    log2_entries = config.field_log2_entries or derive_log2_entries(most_alive, n_shared_knots=n_shared, **most)
    cells = derive_cells(
        side=side,
        spacing=0.0 if config.field_levels else spacing,  # a fixed number of levels does not look at the anchors
        base=config.field_base_cells,
        growth=config.field_growth,
        max_levels=n_levels,
    )
    x, y, z = (lower - margin).tolist()
    sides = (upper - lower).clamp(min=1e-6 * side) / side
    shape = _shape_of(
        n_knots=model.n_frames,
        cells=cells,
        n_entries=2**log2_entries,
        channels=config.field_channels,
        hidden=config.field_hidden,
        feature_dim=config.dynamic_feature_dim,
        bounds_min=(x, y, z),
        side=side,
        is_shared=is_shared,
        strides=derive_strides(len(cells), model.n_frames) if config.field_tables == "graded" else (),
        aspect=tuple(sides.tolist()) if is_published else (1.0, 1.0, 1.0),
        is_rectified=is_published,
    )
    is_published = config.initial == "published"
    model.attach_field(SpatioTemporalField(shape, generator, is_published=is_published))
    return (
        f"Field: {len(cells)} levels of up to {cells[-1]} cells a side (anchors {spacing:.3g} scene units apart), "
        f"{2**log2_entries:,} entries {'in all' if is_shared else 'per frame'} (at most {most_alive:,} anchors alive)"
    )


def _shape_of(**sizes: Any) -> FieldShape:
    try:
        return FieldShape(**sizes)
    except ValueError as error:
        raise PreparationError(
            f"The field of {sizes['n_knots']} frames would have {error}.",
            hint="Take shorter clips, fewer levels or entries, or one table for all frames (field_tables=shared).",
        ) from error


def n_alive(model: ClipModel) -> int:
    """The most dynamic anchors that exist in one frame, summed over the sets."""
    presences = [model.anchor_set(role).presence for role in model.roles()]
    return sum(int(presence.sum(0).max()) for presence in presences if presence is not None and len(presence))


def _alive_positions(model: ClipModel) -> Tensor:
    """Positions of dynamic anchors that exist in some frame, in main memory. [n, 3] float32"""
    parts = [torch.zeros(0, 3)]
    for role in model.roles():
        anchors = model.anchor_set(role)
        if anchors.presence is not None and len(anchors):
            parts.append(anchors.positions.detach()[anchors.presence.any(1)].float().cpu())
    return torch.cat(parts)
