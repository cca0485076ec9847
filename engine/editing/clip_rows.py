"""ClipRows: which numbers the Gaussians of a loaded clip have, the same in every clip that shares them.

Inside a clip each Gaussian has one index: sets follow each other in the order of the model, with all their anchors,
hidden ones too. Everything that is known of a Gaussian beforehand is a table by this index.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine.clip_files.clip_header import ClipHeader
from engine.editing.edit import Picked
from engine.editing.gaussian_rows import GaussianRows, RowSet
from engine.editing.picks import unpack_rows
from engine.errors import ProjectError
from engine.model.clip_model import ClipModel
from engine.model.host_array import host_array


@dataclass(frozen=True, slots=True)
class NamedSet:
    """An anchor set of a clip, and whether it comes from the clip that others inherit from."""

    row_set: RowSet
    is_of_reference: bool


def named_sets(model: ClipModel, header: ClipHeader, reference_index: int) -> dict[str, NamedSet]:
    """Name the sets of a clip as it was loaded, by role.

    Args:
        model: The whole clip, not a part of it.
        header: Of its file.
        reference_index: Of the clip that it inherits from; of no account where it inherits nothing.
    """
    inherits_from = None if header.role == "reference" else header.reference_fingerprint
    named = {}
    for role in model.roles():
        is_own = inherits_from is None or model.anchor_set(role).is_trainable
        origin = header.origin if inherits_from is None or is_own else inherits_from
        row_set = RowSet(origin, header.clip_index if is_own else reference_index, role)
        named[role] = NamedSet(row_set, not is_own or inherits_from is None)
    return named


class ClipRows:
    """Indices of a clip's Gaussians.

    Args:
        model: The clip, or a part of it.
        named: All sets of the clip, of which the part may have some only.

    Attributes:
        gaussians_per_anchor: K.
    """

    def __init__(self, model: ClipModel, named: Mapping[str, NamedSet]) -> None:
        self.sets = tuple(found.row_set for found in named.values())
        self.gaussians_per_anchor = model.decoder.gaussians_per_anchor
        self._anchors: dict[str, np.ndarray] = {}  # number of each row of a set
        self._first: dict[str, int] = {}
        sizes = []
        for role in named:
            self._first[role] = sum(sizes)
            size = 0
            if role in model.roles():
                is_hidden = model.hidden.get(role)
                is_shown = None if is_hidden is None else ~host_array(is_hidden)
                size = len(model.anchor_set(role)) if is_shown is None else len(is_shown)
                self._anchors[role] = np.arange(size) if is_shown is None else np.flatnonzero(is_shown)
            sizes.append(size * self.gaussians_per_anchor)
        self.n = sum(sizes)
        self.set_of = np.repeat(np.arange(len(sizes), dtype=np.uint8), sizes)
        self.number_of = np.concatenate([np.zeros(0, np.int32), *(np.arange(size, dtype=np.int32) for size in sizes)])
        self.is_of_reference = np.repeat([found.is_of_reference for found in named.values()], sizes).astype(bool)
        self._first_of_set = np.concatenate([[0], np.cumsum(sizes)])

    def indices(self, role: str, rows: np.ndarray) -> np.ndarray:
        """Of the Gaussians of some rows of a set, K per row. [n K] int64"""
        first = self._first[role] + self._anchors[role][rows].astype(np.int64) * self.gaussians_per_anchor
        return (first[:, None] + np.arange(self.gaussians_per_anchor)).reshape(-1)

    def named(self, indices: np.ndarray) -> GaussianRows:
        """Where Gaussians of these indices come from."""
        return GaussianRows(self.sets, self.set_of[indices], self.number_of[indices])

    def indices_of(self, rows: GaussianRows) -> np.ndarray:
        """Inverse of `named`, without those of fills, which come last. [n] int64"""
        is_anchored = rows.set_index < len(self.sets)
        return self._first_of_set[rows.set_index[is_anchored]] + rows.number[is_anchored]

    def rows_of_anchors(self, role: str, anchors: np.ndarray) -> np.ndarray:
        """Rows of a set by the numbers of their anchors, none of which is hidden. [n] int64"""
        return np.searchsorted(self._anchors[role], anchors)

    def anchors_among(self, rows: GaussianRows, role: str) -> np.ndarray:
        """Which rows of a set have a Gaussian among these. [A of the set] bool"""
        place = next(place for place, row_set in enumerate(self.sets) if row_set.role == role)
        size = int(self._anchors[role].max(initial=-1)) + 1
        is_there = np.zeros(size, bool)
        is_there[rows.number[rows.set_index == place] // self.gaussians_per_anchor] = True
        return is_there[self._anchors[role]]

    def is_lost(self, target: Picked) -> bool:
        """Whether what was picked was picked in one of these clips, but before it was trained as it is now."""
        clips = {row_set.clip_index for row_set in self.sets}
        concerned = [one for one in target.sets if one.clip_index in clips]
        return bool(concerned) and all(self._place(one.origin, one.role) is None for one in concerned)

    def _place(self, origin: str, role: str) -> int | None:
        return next((i for i, found in enumerate(self.sets) if (found.origin, found.role) == (origin, role)), None)

    def is_picked(self, target: Picked) -> np.ndarray:
        """Which of all Gaussians were picked; none of clips that are not these. [n] bool

        Raises:
            ProjectError: The numbers are damaged.
        """
        is_picked = np.zeros(self.n, bool)
        for one in target.sets:
            place = self._place(one.origin, one.role)
            if place is not None:
                first, stop = self._first_of_set[place : place + 2]
                numbers = _unpacked(one.rows)
                is_picked[first + numbers[numbers < stop - first]] = True
        return is_picked


def _unpacked(rows: bytes) -> np.ndarray:
    try:
        return unpack_rows(rows)
    except ValueError as error:
        hint = "Delete the edit that picked them."
        raise ProjectError(f"An edit cannot be applied: {error}.", hint=hint) from error
