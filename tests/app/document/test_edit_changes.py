"""Changes of the stack of edits: what they make of a document, and what they refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.document.changes import edit_changes as change
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.stored_document import document_of, plain_document
from engine.editing.actions import Delete, Expose, Hide, Recolor, Smooth, Transform
from engine.editing.edit import Box, Everything, Picked, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows
from engine.errors import ProjectError

EMPTY = ProjectDocument(ProjectSettings("capture", "fingerprint"))
BOX = Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


def _three() -> ProjectDocument:
    document = change.add_edit(EMPTY, Hide(), BOX, is_inverted=True)
    document = change.add_edit(document, Delete(), Sphere((0.0, 0.0, 0.0), 1.0), scope=Scope(3, 7))
    return change.add_edit(document, Expose(1.0))


def test_new_edits_lie_on_top_and_have_a_number_of_their_own() -> None:
    document = _three()
    assert [edit.edit_id for edit in document.edits] == [1, 2, 3]
    assert document.edits[2].target == Everything()
    assert document.edits[0].is_inverted
    assert document.edits[1].scope == Scope(3, 7)
    without = change.remove_edit(document, 2)
    assert [edit.edit_id for edit in without.edits] == [1, 3]
    assert change.add_edit(without, Hide()).edits[-1].edit_id == 4
    assert EMPTY.edits == ()


def test_a_copy_lies_right_above_its_original() -> None:
    document = change.duplicate_edit(_three(), 1)
    assert [edit.edit_id for edit in document.edits] == [1, 4, 2, 3]
    assert document.edits[1].target == BOX


@pytest.mark.parametrize(("position", "order"), [(0, [3, 1, 2]), (1, [1, 3, 2]), (2, [1, 2, 3])])
def test_an_edit_is_brought_to_another_position(position: int, order: list[int]) -> None:
    assert [edit.edit_id for edit in change.move_edit(_three(), 3, position).edits] == order


def test_one_edit_changes_and_the_others_stay() -> None:
    document = _three()
    off = change.toggle_edit(document, 2)
    assert [edit.is_on for edit in off.edits] == [True, False, True]
    assert change.toggle_edit(off, 2) == document == change.toggle_edit(document, 2, True)
    renamed = change.rename_edit(document, 2, "  50 % ## floaters ")
    assert renamed.edits[1].name == "50 % ## floaters"
    assert renamed.edits[::2] == document.edits[::2]


@pytest.mark.parametrize("edit_id", [0, 4, -1])
def test_an_edit_that_is_not_there_is_refused(edit_id: int) -> None:
    document = _three()
    for act in (change.remove_edit, change.toggle_edit, change.duplicate_edit, change.edit_with):
        with pytest.raises(ProjectError, match=f"no edit {edit_id}"):
            act(document, edit_id)
    with pytest.raises(ProjectError, match="Position 3 is outside"):
        change.move_edit(document, 1, 3)


def test_what_a_file_may_not_hold_is_refused_at_once() -> None:
    """msgspec checks its limits where it reads, not where a value is made."""
    for scope in (Scope(-5), Scope(2**31)):
        with pytest.raises(ProjectError, match="is not valid"):
            change.add_edit(EMPTY, Hide(), scope=scope)
    with pytest.raises(ProjectError, match="characters"):
        change.rename_edit(_three(), 1, "x" * 201)
    with pytest.raises(ProjectError, match="Unicode"):
        change.rename_edit(_three(), 1, "\ud800")
    broken = Picked((PickedRows(0, "origin", "residual", b"broken"),))
    with pytest.raises(ProjectError, match="damaged"):
        change.add_edit(EMPTY, Hide(), broken)


def test_what_was_changed_is_read_back_as_it_was() -> None:
    picked = Picked((PickedRows(2, "origin", "residual", pack_rows(np.array([3, 5, 9]))),))
    document = _three()
    actions = (Recolor(saturation=0.0), Smooth(2.0), Transform((1.0, 0.0, 0.0), scale=math.pi))
    for action in actions:
        document = change.add_edit(document, action, picked, scope=Scope(0, None, True), name="ö")
    assert document_of(plain_document(document)) == document
