"""Figures of all clips as columns, and columns thinned for the screen. Arithmetic only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.status import SEAM_FLAGGED, SEAM_RATIO_RANGE, ClipStatus, ResidualStatus, SeamStatus

MIN_GROUP_WIDTH = 3.0
"""Clips narrower than this are shown together, units of the screen."""
STATES = ("untrained", "queued", "trained", "preparing", "training", "paused", "stopped", "stale", "failed", "damaged")
"""By how much a user has to see them: of clips that are shown together, the last one counts."""


@dataclass(frozen=True, slots=True)
class ClipColumns:
    """Clips, one entry each.

    Attributes:
        states: Positions in STATES. [n] uint8
        psnr: Held-out PSNR, dB; NaN where not measured. [n] float32
    """

    states: np.ndarray
    psnr: np.ndarray


def clip_columns(clip_states: Sequence[ClipStatus]) -> ClipColumns:
    """Of all clips."""
    places = {state: place for place, state in enumerate(STATES)}
    psnr = [np.nan if status.held_out_psnr is None else status.held_out_psnr for status in clip_states]
    return ClipColumns(
        np.array([places.get(status.state, 0) for status in clip_states], np.uint8), np.array(psnr, np.float32)
    )


def seam_ratios(seams: Sequence[SeamStatus], n_clips: int) -> np.ndarray:
    """Ratio of the boundary before each clip, NaN where not all of it is measured; the first clip has none.
    [n_clips] float32"""
    ratios = np.full(n_clips, np.nan, np.float32)
    for seam in seams:
        ratio = shown_ratio(seam)
        if ratio is not None and 0 < seam.clip_index < n_clips:
            ratios[seam.clip_index] = ratio
    return ratios


def shown_ratio(seam: SeamStatus) -> float | None:
    """The ratio of a seam that is measured in all cameras; where nothing changes inside its clips, so that it has none,
    an end of the scale by its score. None of others: they are neither ranked nor flagged."""
    if seam.is_provisional:
        return None
    if seam.ratio is not None or seam.score is None:
        return seam.ratio
    return SEAM_RATIO_RANGE[1] if seam.score > SEAM_FLAGGED else SEAM_RATIO_RANGE[0]


def provisional_text(seam: SeamStatus) -> str:
    """Figures so far of a seam whose cameras are incomplete; empty for others."""
    if not seam.is_provisional or seam.ratio is None:
        return ""
    return f"~{seam.ratio:.1f} ({seam.n_cameras} of {seam.n_all} cameras)"


def frame_psnr(status: ResidualStatus) -> np.ndarray:
    """PSNR of each frame, mean over the held-out cameras that were measured, over all of them where none is held out;
    NaN where none was. [F] float32, empty where nothing is measured"""
    cells = status.cells.get("psnr")
    if cells is None or not cells.size:
        return np.zeros(0, np.float32)
    is_held_out = np.array(status.is_held_out, bool)
    values = cells[:, is_held_out] if len(is_held_out) == cells.shape[1] and is_held_out.any() else cells
    is_known = np.isfinite(values)
    counts = is_known.sum(axis=1)
    sums = np.where(is_known, values, 0.0).sum(axis=1, dtype=np.float32)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan).astype(np.float32)


def means_of_groups(values: np.ndarray, size: int) -> np.ndarray:
    """Mean of each run of `size` neighbours that are not NaN; NaN where all are. [ceil(n / size)] float32"""
    if size == 1 or len(values) == 0:
        return values
    is_known = np.isfinite(values)
    places = np.arange(0, len(values), size)
    sums = np.add.reduceat(np.where(is_known, values, 0.0), places)
    counts = np.add.reduceat(is_known.astype(np.float32), places)
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan).astype(np.float32)


def group_size(width: float, smallest: float) -> int:
    """How many neighbours of a width are shown together, so that each group is as wide as `smallest`."""
    return max(int(np.ceil(smallest / max(width, 1e-9))), 1)


def largest_of_groups(values: np.ndarray, size: int) -> np.ndarray:
    """Largest value of each run of `size` neighbours; NaN counts only where there is nothing else. [ceil(n / size)]"""
    if size == 1 or len(values) == 0:
        return values
    return np.fmax.reduceat(values, np.arange(0, len(values), size))


def runs_of(values: np.ndarray) -> list[tuple[int, int]]:
    """First and last position of every run of equal values; NaN equals NaN."""
    if len(values) == 0:
        return []
    is_same = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        is_same |= np.isnan(values[1:]) & np.isnan(values[:-1])
    starts = np.concatenate([[0], np.flatnonzero(~is_same) + 1])
    stops = np.concatenate([starts[1:], [len(values)]])
    return list(zip(starts.tolist(), (stops - 1).tolist(), strict=True))


def merged_spans(starts: np.ndarray, stops: np.ndarray, gap: float) -> list[tuple[float, float]]:
    """Rising spans, those joined that are closer together than a gap."""
    if len(starts) == 0:
        return []
    is_first = np.concatenate([[True], starts[1:] - stops[:-1] >= gap])
    firsts = np.flatnonzero(is_first)
    lasts = np.concatenate([firsts[1:] - 1, [len(starts) - 1]])
    return list(zip(starts[firsts].tolist(), stops[lasts].tolist(), strict=True))
