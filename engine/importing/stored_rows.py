"""What of consecutive frames of Gaussians stands still, and which rows of the rest are the same Gaussian."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import reduce

import numpy as np

from engine.clip_files.stored_gaussians import COLUMNS, StoredGaussians
from engine.export.splats import Splats

MEANS = COLUMNS["means"]
"""Centres come first in a row."""
_ORDERED_SHARE = 0.05
"""Rows keep their order where from one frame to the next most move by less than this share of the scene's spread."""
_SAMPLE = 10_000
"""Rows looked at for that."""


def stored_gaussians(frames: Sequence[Splats]) -> StoredGaussians:
    """Consecutive frames as a clip holds them: bit for bit what they are.

    Where all frames have as many rows, in the same order as far as can be told, a row is one Gaussian throughout.
    Elsewhere rows with equal values are, and of the others those that have moved and are the same in all else.
    """
    tables = [_table(splats) for splats in frames]
    if len({len(table) for table in tables}) == 1 and _keep_order(tables):
        is_still = np.ones(len(tables[0]), bool)
        for table in tables[1:]:
            np.logical_and(is_still, (table == tables[0]).all(1), out=is_still)
        presence = np.ones((int((~is_still).sum()), len(tables)), bool)
        return _stored(tables[0][is_still], [table[~is_still] for table in tables], presence)
    keys = [_keys(table) for table in tables]
    lasting = reduce(np.intersect1d, keys)
    still = tables[0][np.isin(keys[0], lasting)]
    moving = [table[~np.isin(key, lasting)] for table, key in zip(tables, keys, strict=True)]
    names = np.concatenate([_keys(table[:, MEANS:]) for table in moving])
    _, first, name = np.unique(names, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))  # tracks in the order in which they appear
    tracks = np.split(rank[name], np.cumsum([len(table) for table in moving])[:-1])
    presence = np.zeros((len(first), len(tables)), bool)
    for frame, found in enumerate(tracks):
        presence[found, frame] = True
    return _stored(still, [table[np.argsort(found)] for table, found in zip(moving, tracks, strict=True)], presence)


def _table(splats: Splats) -> np.ndarray:
    """All columns as bits, so that rows are equal only if nothing differs. [N, 14] uint32"""
    columns = [np.asarray(getattr(splats, name), np.float32).reshape(-1, width) for name, width in COLUMNS.items()]
    return np.ascontiguousarray(np.concatenate(columns, axis=1)).view(np.uint32)


def _stored(still: np.ndarray, moving: Sequence[np.ndarray], presence: np.ndarray) -> StoredGaussians:
    return StoredGaussians(_columns(still), _columns(np.concatenate(moving)), presence)


def _columns(table: np.ndarray) -> dict[str, np.ndarray]:
    values, columns, start = table.view(np.float32), {}, 0
    for name, width in COLUMNS.items():
        part = values[:, start] if width == 1 else values[:, start : start + width]
        columns[name], start = np.ascontiguousarray(part), start + width
    return columns


def _keep_order(tables: Sequence[np.ndarray]) -> bool:
    """Whether equal places hold the same Gaussian, judged by how far most of them move."""
    step = max(len(tables[0]) // _SAMPLE, 1)
    means = [table[::step, :MEANS].view(np.float32).astype(np.float64) for table in tables]
    spread = max(float(np.linalg.norm(means[0] - np.median(means[0], 0), axis=1).mean()) if len(means[0]) else 0, 1e-30)
    ways = [float(np.median(np.linalg.norm(b - a, axis=1))) for a, b in itertools.pairwise(means) if len(a)]
    return max(ways, default=0.0) <= _ORDERED_SHARE * spread


def _keys(table: np.ndarray) -> np.ndarray:
    """A number for the values of each row; rows of one frame that are equal get different ones. [N] uint64

    64 bits: among ten million rows two that differ share a number once in 400,000 scenes.
    """
    key = np.full(len(table), 0x9E3779B97F4A7C15, np.uint64)
    for column in table.T:
        key = (key ^ column) * np.uint64(0xBF58476D1CE4E5B9)
        key ^= key >> np.uint64(29)
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    starts = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]])) if len(key) else np.zeros(0, int)
    lengths = np.diff(np.append(starts, len(key)))
    nth = np.arange(len(key)) - np.repeat(starts, lengths)
    key[order] += nth.astype(np.uint64) * np.uint64(0x94D049BB133111EB)
    return key
