"""Sizes of a field from the data: levels from the distance of anchors, table entries from their number. No torch."""

from __future__ import annotations

import math


def derive_cells(*, side: float, spacing: float, base: int, growth: float, max_levels: int) -> tuple[int, ...]:
    """Cells per level: base * growth^l until a cell is at most 1.5 anchor spacings; finer would be hash noise."""
    cells = [base]
    while len(cells) < max_levels and side / cells[-1] > 1.5 * spacing:
        cells.append(max(cells[-1] + 1, round(base * growth ** len(cells))))
    return tuple(cells)


_STRIDES = (10, 5)
"""Frames for which the finest level keeps its entries, and the next one; others of the finer half keep them for 2."""


def derive_strides(n_levels: int, n_knots: int) -> tuple[int, ...]:
    """Frames for which each level keeps its entries, coarse levels first: those change with every frame."""
    n_own = max(n_levels // 2, min(2, n_levels))
    kept = [*_STRIDES, *(2 for _ in range(n_levels))][: n_levels - n_own]
    return (1,) * n_own + tuple(min(frames, n_knots) for frames in reversed(kept))


def derive_log2_entries(n_alive: int, *, n_shared_knots: int = 1, at_most: int = 17) -> int:
    """log2 of the table entries per level for this many anchors alive in one frame, in a table of so many knots.

    A knot's own table has two entries per anchor; in a shared one half an anchor's entry per knot is enough, because
    most moving things stay near their place. `at_most` limits a shared one.
    """
    if n_shared_knots > 1:
        return min(max(math.ceil(math.log2(max(0.5 * n_alive * n_shared_knots, 1))), 12), at_most)
    return min(max(math.ceil(math.log2(max(2 * n_alive, 1))), 10), 15)
