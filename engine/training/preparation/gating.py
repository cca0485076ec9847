"""Gives static anchors of a clip a dynamic feature where the user marked them.

Promoted anchors get a dynamic feature and continue from their learned values; they exist in every frame, because an
anchor that is there only while it changes would leave a hole while it does not. In the reference clip they become the
set "promoted", which every source clip inherits and lets its own field change. A source clip cannot change
inherited anchors: it hides the static anchor, in this clip alone, and puts one that learns in its place, in the set
"replacing". Every other static anchor stays as it is in all clips, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from engine.cloud.motion.moving_cloud import MovingCloud
from engine.gate.reasons import REASONS, STILL, USER_DYNAMIC, USER_STATIC
from engine.gate.regions import GateRegion, marked
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array


def without_static_regions(cloud: MovingCloud, regions: Sequence[GateRegion]) -> MovingCloud:
    """The moving points outside the regions marked as static."""
    is_kept = ~marked(cloud.points, regions, "static")
    return cloud if is_kept.all() else cloud.chosen(is_kept)


def decide(model: ClipModel, regions: Sequence[GateRegion], *, is_source: bool) -> tuple[dict[str, np.ndarray], str]:
    """Give the static anchors of regions that are marked as dynamic a dynamic feature.

    Args:
        model: Its static set is split; before a field is attached.
        regions: The regions the user marked; later regions overrule earlier ones.
        is_source: Whether the clip inherits from another one.
    Returns:
        Reasons by role, and the decision in one line.
    """
    static = model.anchor_set("static")
    points = host_array(static.positions)
    is_dynamic = marked(points, regions, "dynamic")
    reasons = np.full(len(points), STILL, dtype=np.uint8)
    reasons[marked(points, regions, "static")] = USER_STATIC
    reasons[is_dynamic] = USER_DYNAMIC
    counts = np.bincount(reasons, minlength=len(REASONS))
    said = "; ".join(f"{n} {words}" for n, words in zip(counts, REASONS, strict=True) if n)
    by_role = {"static": reasons}
    if not is_source or static.is_trainable:  # otherwise the inherited set keeps its rows, of which some are hidden
        by_role = {"static": reasons[~is_dynamic]}
        if is_dynamic.any():
            by_role["replacing" if is_source else "promoted"] = reasons[is_dynamic]
    promote(model, is_dynamic, is_source=is_source)
    return by_role, said


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
