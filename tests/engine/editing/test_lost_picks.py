"""Which edits have lost what was picked."""

from __future__ import annotations

import numpy as np

from engine.editing.actions import Hide
from engine.editing.edit import Edit, Everything, Picked, PickedRows
from engine.editing.lost_picks import LostPicks, lost_picks
from engine.editing.picks import pack_rows

ROWS = pack_rows(np.arange(3))


def edit(edit_id: int, *sets: tuple[int, str, str]) -> Edit:
    return Edit(edit_id, "", Picked(tuple(PickedRows(*one, ROWS) for one in sets)), Hide())


def test_picks_of_clips_that_were_trained_anew_are_named() -> None:
    edits = (
        edit(1, (0, "a", "static")),
        edit(2, (0, "older", "static")),
        edit(3, (0, "a", "static"), (1, "older", "residual")),
        Edit(4, "", Everything(), Hide()),
        edit(5, (2, "c", "residual")),
    )
    assert lost_picks(edits, {0: "a", 1: "b"}) == (
        LostPicks(2, (0,), is_all=True),
        LostPicks(3, (1,), is_all=False),
        LostPicks(5, (2,), is_all=True),
    )


def test_anchors_that_are_named_as_before_and_as_now_are_not_lost() -> None:
    assert lost_picks((edit(1, (0, "older", "static"), (0, "a", "static")),), {0: "a"}) == ()
