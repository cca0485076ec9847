"""How many Gaussians a trained clip has, as far as its header states. For the estimate before an export."""

from __future__ import annotations

from engine.clip_files.clip_header import ClipHeader

_ALIVE = 0.3
"""Of the anchors of moving things, those that exist at a moment; where the header does not say how many."""


def expected_rows(header: ClipHeader) -> tuple[int, int]:
    """Gaussians that stand still, and those that move in the frame with most of them, about; drawn or too faint."""
    n_each = header.decoder.gaussians_per_anchor
    n_static = header.n_anchors.get("static", 0)
    n_moving = sum(header.n_anchors.values()) - n_static
    return n_each * n_static, n_each * (round(_ALIVE * n_moving) if header.n_alive is None else header.n_alive)
