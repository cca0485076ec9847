"""A selection as a value: over frames and clips, whole anchors, as the target of an edit, and in words."""

from __future__ import annotations

import re

import numpy as np
import pytest

from app.session.editing.selection import NOTHING_SELECTED, Selection, selection_words, whole_anchors
from engine.editing.edit import Picked, PickedRows
from engine.editing.gaussian_rows import GaussianRows
from tests.app.session.editing.made_frames import MOVING, RESIDUAL, STATIC, K, frame


def rows_of(clip_index: int = 0, hidden: int = 0) -> GaussianRows:
    rows = frame(clip_index, hidden=hidden).rows
    assert rows is not None
    return rows


def mask_of(rows: GaussianRows, *chosen: int) -> np.ndarray:
    return np.isin(np.arange(len(rows)), chosen)


def test_what_is_selected_in_one_clip_is_selected_in_those_that_inherit_it() -> None:
    rows, other = rows_of(), rows_of(1, hidden=5)
    selection = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 3, 8, 20, 45), keeps_others=False)
    assert selection.mask(rows).nonzero()[0].tolist() == [3, 8, 20, 45]
    assert selection.mask(other).nonzero()[0].tolist() == [8 - 5, 20 - 5]  # 3 is hidden there, 45 is another set
    assert dict(selection.parts)[STATIC].tolist() == [3, 8, 20]
    assert dict(selection.parts)[MOVING].tolist() == [5]


@pytest.mark.parametrize("keeps_others", [True, False])
def test_what_a_frame_does_not_show_stays_or_goes_as_asked(keeps_others: bool) -> None:
    rows, other = rows_of(), rows_of(1, hidden=5)
    selection = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 3, 8, 45), keeps_others=False)
    changed = selection.with_mask(other, mask_of(other, 0, 36), keeps_others=keeps_others)
    parts = dict(changed.parts)
    assert parts[STATIC].tolist() == ([3, 5] if keeps_others else [5])
    assert parts[RESIDUAL].tolist() == [1]
    assert (MOVING in parts) == keeps_others


def test_equal_selections_are_equal_however_they_came_about() -> None:
    rows = rows_of()
    one = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 1, 44), keeps_others=False)
    other = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 44), keeps_others=False)
    other = other.with_mask(rows, mask_of(rows, 1, 44), keeps_others=True)
    assert one == other
    assert hash(one) == hash(other)
    assert one != NOTHING_SELECTED
    assert one != other.with_mask(rows, mask_of(rows, 1), keeps_others=True)
    assert NOTHING_SELECTED.with_mask(rows, mask_of(rows), keeps_others=False) == NOTHING_SELECTED


def test_whole_anchors() -> None:
    rows = rows_of(1, hidden=5)
    whole = whole_anchors(rows, mask_of(rows, 0, 8, 36), K)
    # Number 4 is hidden, so that of its anchor only 5 is there; 13 has 12 beside it; of the residual ones 1 has 0.
    assert [(int(rows.set_index[i]), int(rows.number[i])) for i in np.flatnonzero(whole)] == [
        (0, 5),
        (0, 12),
        (0, 13),
        (1, 0),
        (1, 1),
    ]


def test_there_and_back_as_the_target_of_an_edit() -> None:
    rows = rows_of()
    selection = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 0, 39, 40, 49), keeps_others=False)
    target = selection.target()
    assert {(one.clip_index, one.origin, one.role) for one in target.sets} == {
        (0, "first", "static"),
        (0, "first", "moving"),
    }
    assert Selection.of_target(target) == selection
    assert Selection.of_target(Picked(())) == NOTHING_SELECTED
    with pytest.raises(ValueError, match="damaged"):
        Selection.of_target(Picked((PickedRows(0, "first", "static", b"no"),)))


def test_gaussians_anchors_and_clips_are_counted() -> None:
    def counts(selection: Selection, per_anchor: int = K) -> list[str]:
        return re.findall(r"[\d,]*\d", selection_words(selection, per_anchor))

    rows, other = rows_of(), rows_of(1)
    assert selection_words(NOTHING_SELECTED, K) == ""
    one = NOTHING_SELECTED.with_mask(rows, mask_of(rows, 3), keeps_others=False)
    assert counts(one) == ["1", "1", "1"]
    assert counts(one.with_mask(other, mask_of(other, 2, 3, 40), keeps_others=True)) == ["3", "2", "2"]
    assert counts(Selection(((STATIC, np.arange(1240)),)), 5) == ["1,240", "248", "1"]
