"""Flicker, seam ratios and tOF of one result as single numbers, defined once for every table that compares results.

Flicker is the mean over pairs of neighbouring frames of R on static pixels (engine.metrics.clips.seams): how much the
render changes where the truth does not. tOF is the mean of app.lab.added.tof over pairs. Cameras are the held-out
ones, all of them where none was held out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from engine.metrics.clips.seams import ratio_of
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
        rows: Pairs of neighbouring frames, PairRow.as_dict, with `tof` where it was measured.
        borders: Frames that count as the first of a clip; None for the result's own. With borders of another result
            one that has no clips there can be compared.
    """
    pairs = [row for row in rows if row["is_held_out"]] or list(rows)
    parts: tuple[list[dict[str, Any]], list[dict[str, Any]]] = ([], [])
    for row in pairs:
        parts[row["is_boundary"] if borders is None else row["frame_index"] in borders].append(row)
    inside, at = parts
    levels = (mean_of([row["change_static"] for row in part]) for part in parts)
    ratios = (ratio_of(*([row[f"change_{what}"] for row in part] for part in (at, inside))) for what in _PIXELS)
    flows = (mean_of([row.get("tof") for row in part]) for part in (pairs, inside, at))
    in_levels = (None if level is None else 255.0 * level for level in levels)
    return dict(zip(FIGURES, (*in_levels, *ratios, *flows), strict=True))


_PIXELS = ("static", "moving")
