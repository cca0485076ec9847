"""Which anchors of a clip have a dynamic feature: what the gate decided, done to the model.

Promoted anchors get a dynamic feature and go on from what they have learned; they exist in every frame, because an
anchor that is there only while it changes would leave a hole while it does not. In the reference clip they become the
set "promoted", which every source clip inherits and lets its own field change. A source clip cannot touch what it
inherits: it hides the static anchor, in this clip alone, and puts one that learns in its place, in the set
"replacing". Every other static anchor stays as it is in all clips, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from engine.cloud.motion.moving_cloud import MovingCloud
from engine.gate.image_gate import MIN_FRAMES, GateTable
from engine.gate.reasons import INSIDE, STILL, USER_DYNAMIC, USER_STATIC
from engine.gate.regions import GateRegion, marked
from engine.model.clip_model import ClipModel


def nothing_measured(n_anchors: int) -> GateTable:
    """The decision before any picture is looked at: everything is still."""
    reasons = np.full(n_anchors, STILL, dtype=np.uint8)
    return GateTable(np.zeros(n_anchors, dtype=bool), reasons, np.zeros(n_anchors, dtype=np.float32))


def with_inside(table: GateTable, n_inside: np.ndarray, n_frames: int) -> GateTable:
    """A decision with anchors that lie inside a hull: what they belong to may have gone, and only an anchor with a
    dynamic feature can go with it; a static one stays as a ghost. Which of both is left to learning.

    Args:
        n_inside: Frames in which each static anchor lies inside, see engine.gate.inside. [A]
        n_frames: Of the clip.
    """
    is_inside = n_inside >= min(MIN_FRAMES, n_frames)
    reasons = np.where(is_inside, INSIDE, table.reasons).astype(np.uint8)
    return replace(table, is_dynamic=table.is_dynamic | is_inside, reasons=reasons)


def with_regions(table: GateTable, points: np.ndarray, regions: Sequence[GateRegion]) -> GateTable:
    """A decision with what the user marked in place of what was measured; scores stay. points: [A, 3]"""
    is_static, is_dynamic = (marked(points, regions, treat) for treat in ("static", "dynamic"))
    reasons = np.where(is_static, USER_STATIC, np.where(is_dynamic, USER_DYNAMIC, table.reasons)).astype(np.uint8)
    return replace(table, is_dynamic=(table.is_dynamic & ~is_static) | is_dynamic, reasons=reasons)


def without_static_regions(cloud: MovingCloud, regions: Sequence[GateRegion]) -> MovingCloud:
    """What moves outside the regions marked as static."""
    is_kept = ~marked(cloud.points, regions, "static")
    if is_kept.all():
        return cloud
    return replace(cloud, points=cloud.points[is_kept], colors=cloud.colors[is_kept], presence=cloud.presence[is_kept])


def decide(
    model: ClipModel, table: GateTable, regions: Sequence[GateRegion], *, is_source: bool
) -> tuple[dict[str, np.ndarray], str]:
    """Do what was decided to the static anchors, after the user's regions have overruled it.

    Args:
        model: Its static set is split; before a field is attached.
        table: The decision from the pictures, by static anchor.
        regions: Where the user overrules it.
        is_source: Whether the clip inherits from another one.
    Returns:
        Reasons by role, and the decision in one line.
    """
    static = model.anchor_set("static")
    table = with_regions(table, static.positions.numpy(), regions)
    reasons: dict[str, np.ndarray] = {"static": table.reasons}
    if not is_source or static.is_trainable:  # otherwise the inherited set keeps its rows, of which some are hidden
        reasons = {"static": table.reasons[~table.is_dynamic]}
        if table.is_dynamic.any():
            reasons["replacing" if is_source else "promoted"] = table.reasons[table.is_dynamic]
    promote(model, table.is_dynamic, is_source=is_source)
    return reasons, table.summary()


def promote(model: ClipModel, is_dynamic: np.ndarray, *, is_source: bool) -> None:
    """Give static anchors a dynamic feature. Before a field is attached; nothing happens where there are none.

    Args:
        is_dynamic: Rows of the static set. [A] bool
        is_source: Whether the clip inherits from another one, which decides the set they go to.
    """
    if not is_dynamic.any():
        return
    taken = model.take_out("static", torch.from_numpy(is_dynamic))
    everywhere = torch.ones(len(taken), model.n_frames, dtype=torch.bool)
    every_row = torch.ones(len(taken), dtype=torch.bool)
    promoted = taken.subset(every_row, presence=everywhere, is_trainable=True)
    model.add_set("replacing" if is_source else "promoted", promoted)
