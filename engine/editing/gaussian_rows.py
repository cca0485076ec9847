"""GaussianRows: which anchor set each Gaussian of a decoded frame comes from, and its number there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class RowSet:
    """One anchor set, named so that it is the same in every clip that inherits it. See PickedRows."""

    origin: str
    clip_index: int
    role: str


COPIED = RowSet("", 0, "copied")
"""The set of Gaussians that copies of objects add. They are nobody's to select: what is selected are the originals."""


@dataclass(frozen=True, slots=True, eq=False)
class GaussianRows:
    """Where the Gaussians of a frame come from, one row each.

    Attributes:
        sets: The sets that occur.
        set_index: Which of them. [N] uint8
        number: Number of the Gaussian in it: anchor * K + k, hidden anchors counted. [N] int32
    """

    sets: tuple[RowSet, ...]
    set_index: np.ndarray
    number: np.ndarray

    def __len__(self) -> int:
        return len(self.number)

    def __getitem__(self, rows: np.ndarray | slice) -> GaussianRows:
        """The chosen rows, in the given order."""
        return GaussianRows(self.sets, self.set_index[rows], self.number[rows])


def with_copied(rows: GaussianRows, n: int) -> GaussianRows:
    """Rows, and after them those of so many copied Gaussians."""
    place = np.full(n, len(rows.sets), rows.set_index.dtype)
    number = np.concatenate([rows.number, np.arange(n, dtype=rows.number.dtype)])
    return GaussianRows((*rows.sets, COPIED), np.concatenate([rows.set_index, place]), number)
