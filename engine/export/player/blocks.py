"""Blocks: what the page loads at once. One holds what stands still in all clips, and each clip has one of its own.

A block has a part for each level: what makes up most of the pictures comes first, so that the beginning of a block is a
coarse scene.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from engine.conventions import ALPHA_MIN
from engine.export.player.moving_rows import NamedRows, encoded_moving, places_of
from engine.export.player.row_coding import (
    FINE,
    RowPrecision,
    color_max,
    encoded_rows,
    fitting_rounding,
    folded,
    rounded_colors,
)
from engine.export.player.seen_weights import Weigh, weight_by_size
from engine.export.player.still_part import PlayerStillPart, shared_rows, still_part
from engine.export.splats import Splats

LEVEL_SHARES = (0.2, 0.3, 0.5)
"""Of the rows, in each level: with a fifth walls are closed and faces are there; with a tenth they have holes."""
N_LEVELS = len(LEVEL_SHARES)


@dataclass(frozen=True, slots=True)
class Block:
    """Deflated bytes, and what the page has to know to read them.

    Attributes:
        data: Raw deflate streams, one for each level, one after the other.
        description: Plain values for the page's header; see docs/player_format.md.
    """

    data: bytes
    description: dict[str, Any]


class Packer:
    """Makes the blocks of one page, clip by clip. The still part of the first one is shared by all clips.

    Args:
        moving: How finely moving rows are rounded; still ones are rounded finely.
        weigh: Says what comes first.
        unseen: Moving rows that weigh no more than this in any frame of a clip are left out; below 0 none.
    """

    def __init__(self, moving: RowPrecision = FINE, *, weigh: Weigh = weight_by_size, unseen: float = -1.0) -> None:
        self._precision, self._weigh, self._unseen = moving, weigh, unseen
        self._shared: Splats | None = None
        self._shared_colors = np.zeros((0, 3), np.uint8)
        self._shared_levels = np.zeros(0, np.int64)
        self.shared: Block | None = None

    def clip(self, n_frames: int, still: Callable[[int], Splats], moving: Callable[[int], NamedRows]) -> Block:
        """A clip's block; at the first call also the block of what clips share.

        Args:
            n_frames: Of the clip, as far as they are wanted.
            still, moving: The still and the moving splats, by the number of the frame in the clip.
        """
        part = still_part(n_frames, lambda frame: seen(still(frame)))
        if part is None:  # then all of it is stored for every frame
            frames = [NamedRows(joined(seen(still(f)), seen(moving(f).splats))) for f in range(n_frames)]
            part = PlayerStillPart(frames[0].splats[:0], {0: frames[0].splats.colors[:0]})
        else:
            frames = [seen_rows(moving(frame)) for frame in range(n_frames)]
        places = places_of(frames)
        still_weights, weights = self._weights(part.splats, [frame.splats for frame in frames], places)
        if self._shared is None:
            self._share(part, _levels(still_weights))
        pieces: list[list[bytes]] = [[] for _ in range(N_LEVELS)]
        description = self._still(part, _levels(still_weights), pieces)
        description["moving"] = self._moving([frame.splats for frame in frames], places, weights, pieces)
        return deflated(pieces, description)

    def _weights(
        self, still: Splats, frames: Sequence[Splats], places: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of still rows, and of moving ones by their place: the largest in any frame."""
        still_weights = np.zeros(len(still), np.float32)
        weights = np.zeros(1 + max((int(at.max()) for at in places if len(at)), default=-1), np.float32)
        for frame, at in zip(frames, places, strict=True):
            found = self._weigh(joined(still, frame))
            still_weights = np.maximum(still_weights, found[: len(still)])
            weights[at] = np.maximum(weights[at], found[len(still) :])
        return still_weights, weights

    def _share(self, part: PlayerStillPart, levels: np.ndarray) -> None:
        self._shared, self._shared_levels = part.splats, levels
        rounding = fitting_rounding([part.splats])
        self._shared_colors = rounded_colors(self._shared.colors, rounding.color_max)
        rows = [part.splats[np.flatnonzero(levels == level)] for level in range(N_LEVELS)]
        description = {"n": len(part.splats), "levels": [len(one) for one in rows], "rounding": rounding.described()}
        self.shared = deflated([[encoded_rows(one, rounding)] for one in rows], description)

    def _still(self, part: PlayerStillPart, levels: np.ndarray, pieces: list[list[bytes]]) -> dict[str, Any]:
        """Which shared rows are hidden, further rows, and the light on all that remain."""
        assert self._shared is not None
        found, is_hidden = shared_rows(self._shared, part.splats)
        is_own = found < 0
        own = part.splats[np.flatnonzero(is_own)]
        rounding = fitting_rounding([own])
        own_colors = rounded_colors(own.colors, rounding.color_max)
        orders, before, counts = [], [], []
        for level in range(N_LEVELS):
            is_here = self._shared_levels == level
            if is_hidden.any():
                pieces[level].append(np.packbits(is_hidden[is_here], bitorder="little").tobytes())
            kept = np.flatnonzero(~is_own & (np.append(self._shared_levels, -1)[found] == level))
            further = np.flatnonzero(is_own & (levels == level))
            in_own = np.searchsorted(np.flatnonzero(is_own), further)
            if len(own):
                pieces[level].append(encoded_rows(own[in_own], rounding))
            orders.append(np.concatenate([kept, further]))
            before.append(np.concatenate([self._shared_colors[found[kept]], own_colors[in_own]]))
            counts.append(len(further))
        about = {"n": len(own), "levels": counts, "rounding": rounding.described()}
        return {
            "hides": bool(is_hidden.any()),
            "own": about if len(own) else None,
            "light": _light(part.colors, orders, before, pieces),
        }

    def _moving(
        self, frames: Sequence[Splats], places: Sequence[np.ndarray], weights: np.ndarray, pieces: list[list[bytes]]
    ) -> dict[str, Any]:
        kept = [np.flatnonzero(weights[at] > self._unseen) for at in places]
        frames = [frame[rows] for frame, rows in zip(frames, kept, strict=True)]
        places = [at[rows] for at, rows in zip(places, kept, strict=True)]
        is_kept = weights > self._unseen
        levels = np.full(len(weights), -1)
        levels[is_kept] = _levels(weights[is_kept])
        rounding, numbers, n_rows = fitting_rounding(frames, self._precision), [], []
        for level in range(N_LEVELS):
            rows = [np.flatnonzero(levels[at] == level) for at in places]
            data, n = encoded_moving(
                [frame[here] for frame, here in zip(frames, rows, strict=True)],
                [at[here] for at, here in zip(places, rows, strict=True)],
                rounding,
                self._precision.held_steps,
            )
            pieces[level].append(data)
            numbers.append([len(here) for here in rows])
            n_rows.append(n)
        totals = [len(frame) for frame in frames]
        return {"n": totals, "levels": numbers, "rows": n_rows, "rounding": rounding.described()}


def _levels(weights: np.ndarray) -> np.ndarray:
    """The level of each row: the heaviest ones come first. [N] int64"""
    rank = np.empty(len(weights), np.int64)
    rank[np.argsort(-weights, kind="stable")] = np.arange(len(weights))
    ends = np.cumsum(LEVEL_SHARES[:-1]) * len(weights)
    return np.searchsorted(ends, rank, side="right")


def _light(
    colors: dict[int, np.ndarray], orders: list[np.ndarray], before: list[np.ndarray], pieces: list[list[bytes]]
) -> dict[str, Any] | None:
    """Colours of what stands still at some frames; None where they are those of the rows throughout.

    Args:
        colors: By number of the frame in the clip.
        orders: The rows of each level.
        before: Their colours as the rows have them. [n, 3] uint8 each
        pieces: Where to put them, by level.
    """
    brightest = color_max(list(colors.values()))
    levels = {frame: rounded_colors(values, brightest) for frame, values in colors.items()}
    is_as_before = [
        np.array_equal(next(iter(levels.values()))[rows], old) for rows, old in zip(orders, before, strict=True)
    ]
    if len(levels) == 1 and all(is_as_before):
        return None
    for rows, old, found in zip(orders, before, pieces, strict=True):
        for values in levels.values():
            found.append(np.ascontiguousarray(folded(values[rows] - old).T).tobytes())
            old = values[rows]
    return {"frames": list(levels), "color_max": brightest}


def seen_rows(rows: NamedRows) -> NamedRows:
    """Rows that are not too faint to be drawn anywhere."""
    return rows[np.flatnonzero(rows.splats.opacities > ALPHA_MIN)]


def seen(splats: Splats) -> Splats:
    """Rows that are not too faint to be drawn anywhere."""
    return splats[np.flatnonzero(splats.opacities > ALPHA_MIN)]


def joined(*parts: Splats) -> Splats:
    """Rows after rows."""
    names = ("means", "quats", "scales", "opacities", "colors")
    columns: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(parts[0], **columns)


def deflated(levels: Sequence[Sequence[bytes]], description: dict[str, Any]) -> Block:
    """A block of the bytes of each level."""
    parts = []
    for pieces in levels:
        packer = zlib.compressobj(zlib.Z_BEST_COMPRESSION, zlib.DEFLATED, -zlib.MAX_WBITS, 9, zlib.Z_FILTERED)
        parts.append(b"".join([*(packer.compress(piece) for piece in pieces), packer.flush()]))
    sizes = [[len(part), sum(map(len, pieces))] for part, pieces in zip(parts, levels, strict=True)]
    return Block(b"".join(parts), {**description, "parts": sizes})
