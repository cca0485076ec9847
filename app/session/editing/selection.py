"""Selection: Gaussians that the user has selected, by the numbers that they have in every frame and in every clip that
inherits them. An immutable value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engine.editing.edit import Picked, PickedRows
from engine.editing.fills.fill import FILLED, GUESSED
from engine.editing.gaussian_rows import GaussianRows, RowSet
from engine.editing.picks import pack_rows, unpack_rows


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """The selected Gaussians.

    Attributes:
        parts: Numbers of Gaussians by anchor set, rising, each once; no set without any. [n] int64 each
    """

    parts: tuple[tuple[RowSet, np.ndarray], ...] = ()

    def __len__(self) -> int:
        """Gaussians."""
        return sum(len(numbers) for _, numbers in self.parts)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Selection):
            return NotImplemented
        own, others = dict(self.parts), dict(other.parts)
        return own.keys() == others.keys() and all(np.array_equal(own[key], others[key]) for key in own)

    def __hash__(self) -> int:
        return hash(frozenset((row_set, len(numbers)) for row_set, numbers in self.parts))

    def n_anchors(self, gaussians_per_anchor: int) -> int:
        """Anchors of which at least one Gaussian is selected."""
        return sum(len(np.unique(numbers // gaussians_per_anchor)) for _, numbers in self.parts)

    @property
    def clip_indices(self) -> tuple[int, ...]:
        """Clips that trained the selected Gaussians."""
        return tuple(sorted({row_set.clip_index for row_set, _ in self.parts}))

    @property
    def counts(self) -> tuple[tuple[RowSet, int], ...]:
        """Anchor sets, and how many Gaussians of each are selected."""
        return tuple((row_set, len(numbers)) for row_set, numbers in self.parts)

    def mask(self, rows: GaussianRows) -> np.ndarray:
        """Which of the Gaussians of a frame are selected. [N] bool"""
        mask, known = np.zeros(len(rows), np.bool_), dict(self.parts)
        for numbers, is_here in _shared(rows, known):
            here = rows.number[is_here]
            table = np.zeros(max(int(numbers[-1]), int(here.max(initial=0))) + 1, np.bool_)
            table[numbers] = True
            mask[is_here] = table[here]
        return mask

    def with_mask(self, rows: GaussianRows, mask: np.ndarray, *, keeps_others: bool) -> Selection:
        """A selection in which, of the Gaussians of a frame, just those of a mask are selected.

        Args:
            mask: [N] bool
            keeps_others: Whether selected Gaussians that do not exist in this frame stay selected.
        """
        parts = dict(self.parts) if keeps_others else {}
        for place, row_set in enumerate(rows.sets):
            if row_set.role in (FILLED, GUESSED):  # of no anchor: they belong to their edit
                continue
            is_here, kept = rows.set_index == place, parts.get(row_set, _NONE)
            here = rows.number[is_here]
            table = np.zeros(max(int(kept.max(initial=-1)), int(here.max(initial=-1))) + 1, np.bool_)
            table[kept] = True
            table[here] = mask[is_here]
            parts[row_set] = np.flatnonzero(table)
        return Selection(tuple((row_set, numbers) for row_set, numbers in parts.items() if len(numbers)))

    def target(self) -> Picked:
        """The same as the target of an edit."""
        return Picked(
            tuple(
                PickedRows(row_set.clip_index, row_set.origin, row_set.role, pack_rows(numbers))
                for row_set, numbers in self.parts
            )
        )

    @classmethod
    def of_target(cls, target: Picked) -> Selection:
        """The target of an edit as a selection.

        Raises:
            ValueError: The numbers are damaged.
        """
        unpacked = ((RowSet(one.origin, one.clip_index, one.role), unpack_rows(one.rows)) for one in target.sets)
        return cls(tuple((row_set, numbers) for row_set, numbers in unpacked if len(numbers)))


_NONE = np.zeros(0, np.int64)
NOTHING_SELECTED = Selection()


def _shared(rows: GaussianRows, known: dict[RowSet, np.ndarray]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Numbers that are known of each set of a frame, and its rows."""
    for place, row_set in enumerate(rows.sets):
        if row_set in known:
            yield known[row_set], rows.set_index == place


def whole_anchors(rows: GaussianRows, mask: np.ndarray, gaussians_per_anchor: int) -> np.ndarray:
    """A mask over the Gaussians of a frame with all those that belong to anchors of which one is in it. [N] bool"""
    whole = mask.copy()
    for place in range(len(rows.sets)):
        is_here = rows.set_index == place
        anchors = rows.number[is_here] // gaussians_per_anchor
        table = np.zeros(int(anchors.max(initial=0)) + 1, np.bool_)
        table[anchors[mask[is_here]]] = True
        whole[is_here] = table[anchors]
    return whole


def selection_words(selection: Selection, gaussians_per_anchor: int) -> str:
    """For the status line: "1,240 Gaussians, 96 anchors, 3 clips"; empty where nothing is selected."""
    if not len(selection):
        return ""
    counts = (
        (len(selection), "Gaussian"),
        (selection.n_anchors(gaussians_per_anchor), "anchor"),
        (len(selection.clip_indices), "clip"),
    )
    return ", ".join(f"{count:,} {word}{'' if count == 1 else 's'}" for count, word in counts)
