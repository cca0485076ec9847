"""The still part: rows that the clips of a capture share are stored once, and each clip says which of them it shows,
its further rows, and in which light they stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.export.splats import Splats

SAME_COLOR = 0.25 / 255.0
"""Colours nearer to each other than this are the same after rounding, or nearly so."""


@dataclass(frozen=True, slots=True)
class PlayerStillPart:
    """The still part of one clip.

    Attributes:
        splats: At the clip's first frame. [N rows]
        colors: At some of its frames, by their number in the clip and rising; between them colours are linear in time.
            [N, 3] each
    """

    splats: Splats
    colors: dict[int, np.ndarray]


def still_part(n_frames: int, at: Callable[[int], Splats]) -> PlayerStillPart | None:
    """The still part of a clip; None where anything but colours differs between its frames.

    Args:
        n_frames: Of the clip.
        at: Gaussians by the number of a frame in the clip.
    """
    first, last = at(0), at(n_frames - 1)
    is_even = True  # whether colours are linear in time
    for frame in range(1, n_frames):
        other = last if frame == n_frames - 1 else at(frame)
        if not _has_same_shapes(first, other):
            return None
        share = np.float32(frame / (n_frames - 1))
        is_even = is_even and not _differs(other.colors, first.colors + (last.colors - first.colors) * share)
    if not is_even:
        return PlayerStillPart(first, {frame: at(frame).colors for frame in range(n_frames)})
    if _differs(first.colors, last.colors):
        return PlayerStillPart(first, {0: first.colors, n_frames - 1: last.colors})
    return PlayerStillPart(first, {0: first.colors})


def _differs(some: np.ndarray, others: np.ndarray) -> bool:
    return bool(np.abs(some - others).max(initial=0.0) > SAME_COLOR)


def _has_same_shapes(some: Splats, others: Splats) -> bool:
    return len(some) == len(others) and np.array_equal(shapes(some), shapes(others))


def shapes(splats: Splats) -> np.ndarray:
    """All numbers of a row but its colour. [N, 11] float32"""
    return np.concatenate([splats.means, splats.quats, splats.scales, splats.opacities[:, None]], axis=1)


def shared_rows(shared: Splats, splats: Splats) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a clip that are among the shared ones, whatever their colours are.

    Args:
        shared: [S rows]
        splats: Of the clip. [N rows]
    Returns:
        For each row of `splats` its row in `shared`, each at most once and rising, or -1. [N] int64
        Which rows of `shared` are none of them. [S] bool
    """
    ours, theirs = shapes(shared), shapes(splats)
    if np.array_equal(ours, theirs):
        return np.arange(len(theirs)), np.zeros(len(ours), bool)
    names = _names(np.concatenate([ours, theirs]))
    ours_names, theirs_names = _numbered(names[: len(ours)]), _numbered(names[len(ours) :])
    _, rows, places = np.intersect1d(theirs_names, ours_names, assume_unique=True, return_indices=True)
    found = np.full(len(splats), -1, np.int64)
    found[rows] = places
    before = np.maximum.accumulate(np.concatenate([[-1], found]))[:-1]
    found[found <= before] = -1  # in order, so that a list of bits is enough to say which
    is_hidden = np.ones(len(shared), bool)
    is_hidden[found[found >= 0]] = False
    return found, is_hidden


def _names(rows: np.ndarray) -> np.ndarray:
    """The same number for rows of the same bytes. [N] int64"""
    whole = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.itemsize * rows.shape[1])))[:, 0]
    return np.unique(whole, return_inverse=True)[1].astype(np.int64)


def _numbered(names: np.ndarray) -> np.ndarray:
    """Names that differ: the second row of one name has another than the first one, and so on. [N] int64"""
    order = np.argsort(names, kind="stable")
    ordered = names[order]
    rank = np.arange(len(names)) - np.searchsorted(ordered, ordered)
    numbered = np.empty_like(names)
    numbered[order] = (ordered << 32) + rank
    return numbered
