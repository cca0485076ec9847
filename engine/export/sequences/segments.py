"""Segments: Gaussians that move, as rows that hold for several frames each, with a straight path and fixed looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from engine.export.sequences.sequence import MovingSplats
from engine.export.splats import THINNEST

PATH_SHARE = 0.12
"""A segment's path passes each position this near: a share of the Gaussian's mean size, for one that hides what is
behind it; see FAINT."""
SCALE_RATIO = 0.1
"""Natural logarithms of scales are this near."""
OPACITY = 0.03
COLOR = 0.015
"""Opacities and colours are this near; colours of faint Gaussians less so."""
FAINT = 0.05
"""A Gaussian of less than full opacity may be off by more, since that is seen less: paths by one over the root of its
opacity, colours by one over it. Fainter ones than this count as this opaque."""
SAME_TURN = 0.996
"""Dot product of the quaternions of rotations that are near enough: they are 10 degrees apart."""


@dataclass(frozen=True, slots=True)
class Segments:
    """Rows in the order of their ids, and of one id in that of time.

    Attributes:
        ids: [N] int64
        first, end: Frames, counted from that of the first one that was given. [N] int64
        means: At the first frame. [N, 3] float32
        velocities: Scene units per frame; 0 in rows of one frame. [N, 3] float32
        quats, scales, opacities, colors: As of Splats.
    """

    ids: np.ndarray
    first: np.ndarray
    end: np.ndarray
    means: np.ndarray
    velocities: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray

    def __len__(self) -> int:
        return len(self.ids)


def segments(frames: Sequence[MovingSplats]) -> Segments:
    """The fewest rows that a greedy pass finds: a segment lasts for as long as some line and some fixed looks are
    near enough to all of its frames. frames: consecutive ones, at least one."""
    ids = np.unique(np.concatenate([frame.ids for frame in frames]))
    open_rows = _OpenSegments(ids)
    for number, frame in enumerate(frames):
        open_rows.add(number, frame)
    return open_rows.closed(len(frames))


class _OpenSegments:
    """The segment that is open for each id, and all that are closed."""

    def __init__(self, ids: np.ndarray) -> None:
        n = len(ids)
        self._ids = ids
        self._is_open = np.zeros(n, bool)
        self._first = np.zeros(n, np.int64)
        self._start = np.zeros((n, 3))
        self._slowest, self._fastest = np.zeros((n, 3)), np.zeros((n, 3))
        self._lowest, self._highest = np.zeros((n, 7)), np.zeros((n, 7))
        self._quats = np.zeros((n, 4), np.float32)
        self._closed: list[Segments] = []

    def add(self, number: int, frame: MovingSplats) -> None:
        """Add the next frame."""
        splats, at = frame.splats, np.searchsorted(self._ids, frame.ids)
        logs = np.log(np.maximum(splats.scales.astype(np.float64), THINNEST))
        weight = np.maximum(splats.opacities.astype(np.float64), FAINT)[:, None]
        reach = PATH_SHARE * np.exp(logs.mean(1, keepdims=True)) / np.sqrt(weight)
        looks = np.concatenate([logs / SCALE_RATIO, splats.opacities[:, None] / OPACITY, splats.colors / COLOR], axis=1)
        means = splats.means.astype(np.float64)

        n_steps = np.maximum(number - self._first[at], 1)[:, None]
        slowest = np.maximum(self._slowest[at], (means - reach - self._start[at]) / n_steps)
        fastest = np.minimum(self._fastest[at], (means + reach - self._start[at]) / n_steps)
        lowest, highest = np.minimum(self._lowest[at], looks), np.maximum(self._highest[at], looks)
        spread = highest - lowest
        spread[:, 4:] *= weight
        goes_on = self._is_open[at] & (slowest <= fastest).all(1) & (spread <= 2.0).all(1)
        goes_on &= np.abs((self._quats[at] * splats.quats).sum(1)) > SAME_TURN

        kept = at[goes_on]
        is_ending = self._is_open.copy()
        is_ending[kept] = False
        self._close(np.flatnonzero(is_ending), number)
        self._slowest[kept], self._fastest[kept] = slowest[goes_on], fastest[goes_on]
        self._lowest[kept], self._highest[kept] = lowest[goes_on], highest[goes_on]

        begun = at[~goes_on]
        self._is_open[begun] = True
        self._first[begun] = number
        self._start[begun] = means[~goes_on]
        self._slowest[begun], self._fastest[begun] = -np.inf, np.inf
        self._lowest[begun] = self._highest[begun] = looks[~goes_on]
        self._quats[begun] = splats.quats[~goes_on]

    def _close(self, rows: np.ndarray, end: int) -> None:
        middle = 0.5 * (self._lowest[rows] + self._highest[rows])
        is_longer = end - self._first[rows] > 1
        velocities = np.zeros((len(rows), 3))
        moved = rows[is_longer]
        velocities[is_longer] = 0.5 * (self._slowest[moved] + self._fastest[moved])
        found = Segments(
            ids=self._ids[rows],
            first=self._first[rows],
            end=np.full(len(rows), end),
            means=self._start[rows].astype(np.float32),
            velocities=velocities.astype(np.float32),
            quats=self._quats[rows],
            scales=np.exp(middle[:, :3] * SCALE_RATIO).astype(np.float32),
            opacities=(middle[:, 3] * OPACITY).astype(np.float32),
            colors=(middle[:, 4:] * COLOR).astype(np.float32),
        )
        self._closed.append(found)
        self._is_open[rows] = False

    def closed(self, end: int) -> Segments:
        """All of them, in order."""
        self._close(np.flatnonzero(self._is_open), end)
        columns = {
            column.name: np.concatenate([getattr(part, column.name) for part in self._closed])
            for column in fields(Segments)
        }
        order = np.lexsort((columns["first"], columns["ids"]))
        return Segments(**{name: values[order] for name, values in columns.items()})
