"""Flicker, seam ratios and tOF of one result as single numbers, defined once for every table that sets results beside
each other.

Flicker is the mean over pairs of neighbouring frames of R on static pixels (engine.metrics.clips.seams): how much the
render changes where the truth does not. tOF is the mean of engine.metrics.clips.tof over pairs. Cameras are the
held-out ones, all of them where none was held out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from engine.metrics.clips.seams import PairRow, ratio
from engine.metrics.clips.summary import mean_of

FLOW_FIGURES = ("tof", "tof_inside", "tof_borders")
FIGURES = ("flicker_inside", "flicker_borders", "seam_ratio_static", "seam_ratio_moving", *FLOW_FIGURES)
OWN_BORDERS = "the borders are those of each result's own clips"


def definition_of(borders: str = OWN_BORDERS) -> str:
    """One sentence for below a table. borders: which frames count as borders, as a clause."""
    return (
        "Flicker: mean change of the render (R) on pixels where the truth stands still, from one frame to the next, in "
        "1/255, inside clips and at clip borders. Seam ratio: R at borders / R inside clips, on static or on moving "
        "pixels; 1 means no seam. tOF: how far the optical flow of the render is from that of the truth, px per frame, "
        "on average, inside clips and at borders; only with all metrics. Held-out cameras, all where none is held out; "
        f"{borders}."
    )


def flicker_figures(rows: Sequence[dict[str, Any]], borders: Collection[int] | None = None) -> dict[str, float | None]:
    """Flicker in 1/255, seam ratios, and tOF in px per frame; None where there is no such pair or quotient.

    Args:
        rows: Pairs of neighbouring frames, PairRow.as_dict.
        borders: Frames that count as the first of a clip; None for the result's own. With borders of another result
            one that has no clips there can be compared.
    """
    pairs = [PairRow(**row) for row in rows]
    pairs = [pair for pair in pairs if pair.is_held_out] or pairs
    if borders is not None:
        pairs = [replace(pair, is_boundary=pair.frame_index in borders) for pair in pairs]
    at, inside = ([pair for pair in pairs if pair.is_boundary == is_border] for is_border in (True, False))
    levels = (mean_of([pair.change_static for pair in part]) for part in (inside, at))
    ratios = (ratio(at, inside, f"change_{part}") for part in ("static", "moving"))
    flows = (mean_of([pair.tof for pair in part]) for part in (pairs, inside, at))
    in_levels = (None if level is None else 255.0 * level for level in levels)
    return dict(zip(FIGURES, (*in_levels, *ratios, *flows), strict=True))
