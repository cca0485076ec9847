"""Rows of a .tsog: Gaussians with the frame at which each is shown, and the speed at which it travels there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from engine.export.packing import morton_order
from engine.export.player.blocks import joined
from engine.export.player.still_part import shapes, shared_rows
from engine.export.sequences.sequence import MovingSplats, SequenceStretch
from engine.export.splats import Splats

SAME_COLOR = 4.0 / 255.0
"""A Gaussian stands still where nothing else of it changes and its colours differ by less than this. It gets the colour
in the middle: two levels off at most."""
EVERY_FRAME = -1


@dataclass(frozen=True, slots=True)
class TimedRows:
    """Gaussians of a file.

    Attributes:
        frames: Where each is shown, or EVERY_FRAME. [N] int32
        splats: N of them.
        speeds: Units per frame. [N, 3] float32
    """

    frames: np.ndarray
    splats: Splats
    speeds: np.ndarray


@dataclass(frozen=True, slots=True)
class StretchRows:
    """The Gaussians of a stretch.

    Attributes:
        first_frame, n_frames: As of SequenceStretch.
        still: What changes only its light, in the same order in every stretch.
        moving: One Gaussian after the other, each frame by frame: a quarter smaller as pictures than frame after frame.
        n_followed: So many of those are there in a neighbouring frame, too.
    """

    first_frame: int
    n_frames: int
    still: Splats
    moving: TimedRows
    n_followed: int


def stretch_rows(stretch: SequenceStretch, count: Callable[[int, int], None]) -> StretchRows:
    """The rows of a stretch.

    Args:
        count: Called with each frame and the number of its rows as soon as that is known; may raise.
    """
    end, n_followed = stretch.first_frame + stretch.n_frames, 0
    ids, frames, splats, speeds = list[np.ndarray](), list[np.ndarray](), list[Splats](), list[np.ndarray]()
    before, now = None, stretch.moving(stretch.first_frame)
    for frame in range(stretch.first_frame, end):
        after = stretch.moving(frame + 1) if frame + 1 < end else None
        steps, n = _steps(now, before, after)
        n_followed += int((n > 0).sum())
        count(frame, len(now.ids))
        ids.append(now.ids)
        frames.append(np.full(len(now.ids), frame, np.int32))
        splats.append(now.splats)
        speeds.append(steps)
        if after is not None:
            before, now = now, after
    names = np.concatenate(ids)
    order = np.lexsort((np.concatenate(frames), names))
    rows = TimedRows(np.concatenate(frames)[order], joined(*splats)[order], np.concatenate(speeds)[order])
    more, is_still = _standing_still(rows.splats, names[order], stretch.n_frames)
    moving = TimedRows(rows.frames[~is_still], rows.splats[~is_still], rows.speeds[~is_still])
    still = joined(stretch.still, more)
    still = still[np.lexsort(shapes(still).T)]
    return StretchRows(stretch.first_frame, stretch.n_frames, still, moving, n_followed - int(is_still.sum()))


def _steps(now: MovingSplats, before: MovingSplats | None, after: MovingSplats | None) -> tuple[np.ndarray, np.ndarray]:
    """Mean steps from and to the neighbouring frames, scene units, and from how many of them. [N, 3] float32; [N]"""
    steps, n = np.zeros((len(now.ids), 3)), np.zeros(len(now.ids))
    for other, sign in ((before, -1.0), (after, 1.0)):
        if other is not None:
            _, mine, theirs = np.intersect1d(now.ids, other.ids, assume_unique=True, return_indices=True)
            steps[mine] += sign * (other.splats.means[theirs].astype(np.float64) - now.splats.means[mine])
            n[mine] += 1.0
    return (steps / np.maximum(n, 1.0)[:, None]).astype(np.float32), n


def _standing_still(splats: Splats, ids: np.ndarray, n_frames: int) -> tuple[Splats, np.ndarray]:
    """What is at all frames and changes only its light, once each; and which of the rows that are. [N] bool

    Args:
        splats: Those of one id after another. N of them.
        ids: [N]
    """
    first = np.flatnonzero(np.diff(ids, prepend=ids[:1] - 1))
    if n_frames == 1 or not len(first):
        return splats[:0], np.zeros(len(ids), bool)
    n_each = np.diff(first, append=len(ids))
    values = shapes(splats)
    is_still = (n_each == n_frames) & (np.minimum.reduceat(values, first) == np.maximum.reduceat(values, first)).all(1)
    low, high = np.minimum.reduceat(splats.colors, first), np.maximum.reduceat(splats.colors, first)
    is_still &= (high - low <= SAME_COLOR).all(1)
    found = replace(splats[first], colors=(low + high) / np.float32(2.0))[is_still]
    return found, np.repeat(is_still, n_each)


def shared_still(stretches: Sequence[StretchRows]) -> tuple[Splats, list[Splats]]:
    """What stands still in all stretches, in colours between theirs, and what else stands still in each."""
    first = stretches[0].still
    is_shared = np.ones(len(first), bool)
    low, high = first.colors.copy(), first.colors.copy()
    found = []
    for stretch in stretches:
        rows, is_hidden = shared_rows(first, stretch.still)
        colors, at = stretch.still.colors[rows >= 0], rows[rows >= 0]
        low[at], high[at] = np.minimum(low[at], colors), np.maximum(high[at], colors)
        is_shared &= ~is_hidden
        found.append(rows)
    is_shared &= (high - low <= SAME_COLOR).all(1)
    is_left = [np.where(rows >= 0, ~np.append(is_shared, False)[rows], True) for rows in found]
    others = [one.still[is_other] for one, is_other in zip(stretches, is_left, strict=True)]
    return replace(first, colors=(low + high) / np.float32(2.0))[is_shared], others


def at_every_frame(still: Splats) -> TimedRows:
    """What stands still throughout, along a curve through space."""
    n = len(still)
    return TimedRows(np.full(n, EVERY_FRAME, np.int32), still[morton_order(still.means)], np.zeros((n, 3), np.float32))


def repeated(stretch: StretchRows, still: Splats) -> TimedRows:
    """What stands still in a stretch, at each of its frames."""
    n = stretch.n_frames
    frames = np.tile(np.arange(stretch.first_frame, stretch.first_frame + n, dtype=np.int32), len(still))
    along = still[np.repeat(morton_order(still.means), n)]
    return TimedRows(frames, along, np.zeros((len(frames), 3), np.float32))
