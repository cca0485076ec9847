"""Edits, markers, labels and the world through the session: named steps, merged drags, 500 steps back and forth."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from app.document.storing.stored_document import plain_document
from app.session.editing.edit_commands import (
    AddEdit,
    ChangeEdit,
    DuplicateEdit,
    GoToStep,
    MoveEdit,
    MoveMarker,
    PutMarker,
    Redo,
    RemoveEdit,
    RemoveMarker,
    RenameEdit,
    SetLabel,
    SetScale,
    SetUp,
    ToggleEdit,
    Undo,
)
from app.session.editing.selection import Selection
from engine.editing.actions import Delete, Expose, Hide, Recolor
from engine.editing.edit import Box, Scope, Sphere
from engine.editing.gaussian_rows import RowSet
from engine.storage.json_files import json_text

BOX = Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))


@pytest.fixture
def session(make_session):
    return make_session()


def test_a_box_crop_is_a_named_step_that_goes_and_comes(session):
    session.dispatch(AddEdit(Hide(), BOX, is_inverted=True))
    assert [edit.edit_id for edit in session.edits.edits] == [1]
    assert session.history.undo == "crop to box 1 × 1 × 1"
    session.dispatch(ToggleEdit(1))
    assert session.history.undo == "switch off: crop to box 1 × 1 × 1"
    assert not session.edits.edits[0].is_on
    session.dispatch(Undo())
    assert session.edits.edits[0].is_on
    assert session.history.redo == "switch off: crop to box 1 × 1 × 1"
    session.dispatch(Undo())
    assert session.edits.edits == ()
    assert len(session.notices) == 0


def test_a_drag_is_one_step_and_another_drag_is_another(session):
    session.dispatch(AddEdit(Hide(), BOX))
    for gesture, sizes in ((1, (0.6, 0.7, 0.8)), (2, (0.9, 1.0))):
        for size in sizes:
            edit = structs.replace(session.edits.edits[0], target=Box(BOX.center, (size, 0.5, 0.5)))
            session.dispatch(ChangeEdit(edit, gesture, "resize"))
    assert session.history.past == ("hide box 1 × 1 × 1", "resize: hide box 1 × 1 × 1", "resize: hide box 1.6 × 1 × 1")
    session.dispatch(Undo())
    assert session.edits.edits[0].target.half_sizes[0] == 0.8
    session.dispatch(Undo())
    assert session.edits.edits[0].target == BOX


def test_the_stack_is_reordered_copied_renamed_and_thinned(session):
    for action in (Hide(), Delete(), Expose(1.0)):
        session.dispatch(AddEdit(action, BOX, Scope(2, 4)))
    session.dispatch(MoveEdit(3, 0))
    session.dispatch(DuplicateEdit(3))
    session.dispatch(RenameEdit(4, "brighter"))
    session.dispatch(RemoveEdit(2))
    assert [edit.edit_id for edit in session.edits.edits] == [3, 4, 1]
    assert session.edits.edit(4).name == "brighter"
    n_steps = len(session.history.past)
    session.dispatch(MoveEdit(3, 0))
    session.dispatch(RenameEdit(4, "brighter "))
    assert len(session.history.past) == n_steps, "what changes nothing does not become a step"


def test_what_cannot_be_is_said_and_changes_nothing(session):
    session.dispatch(RemoveEdit(7))
    session.dispatch(AddEdit(Hide(), BOX, Scope(-3)))
    session.dispatch(SetUp((0.0, 0.0, 0.0)))
    session.dispatch(MoveMarker(3, 4))
    assert [notice.title for notice in session.notices] == ["The edit cannot be made"] * 4
    assert session.history.past == ()


def test_one_jumps_to_any_step(session):
    for radius in (1.0, 2.0, 3.0, 4.0):
        session.dispatch(AddEdit(Hide(), Sphere((0.0, 0.0, 0.0), radius)))
    session.dispatch(GoToStep(-3))
    assert len(session.edits.edits) == 1
    assert session.history.future == tuple(f"hide sphere of radius {radius}" for radius in (2, 3, 4))
    session.dispatch(GoToStep(2))
    assert len(session.edits.edits) == 3
    session.dispatch(GoToStep(-100))
    assert session.edits.edits == ()
    session.dispatch(GoToStep(100))
    assert len(session.edits.edits) == 4


@pytest.mark.slow
def test_five_hundred_steps_back_and_forth_are_the_same_documents(session):
    random = np.random.default_rng(0)
    texts = [json_text(plain_document(session.document.content))]
    while len(texts) <= 500:
        edits = session.edits.edits
        edit_id = int(random.choice([edit.edit_id for edit in edits])) if edits else 0
        command = [
            AddEdit(Hide(), Sphere((0.0, 0.0, 0.0), float(random.uniform(0.1, 2.0)))),
            ToggleEdit(edit_id),
            RenameEdit(edit_id, f"name {random.integers(1000)}"),
            MoveEdit(edit_id, int(random.integers(max(len(edits), 1)))),
            PutMarker(int(random.integers(9)), f"marker {random.integers(1000)}"),
            RemoveEdit(edit_id),
            SetLabel("clip", "0", f"label {random.integers(1000)}"),
            SetScale(float(random.uniform(0.1, 3.0))),
        ][int(random.integers(8))]
        if (edit_id == 0 and hasattr(command, "edit_id")) or (isinstance(command, RemoveEdit) and len(edits) < 5):
            continue
        session.dispatch(command)
        text = json_text(plain_document(session.document.content))
        if text != texts[-1]:
            texts.append(text)
    for text in reversed(texts[:-1]):
        session.dispatch(Undo())
        assert json_text(plain_document(session.document.content)) == text
    for text in texts[1:]:
        session.dispatch(Redo())
        assert json_text(plain_document(session.document.content)) == text
    assert len(session.notices) == 0


def test_markers_and_up_are_shown_at_once_and_come_back_with_undo(session):
    session.dispatch(PutMarker(3, "foul", 1))
    session.dispatch(PutMarker(3, "foul!", 1))
    session.dispatch(MoveMarker(3, 5, 2))
    assert [(marker.frame_index, marker.text) for marker in session.timeline.markers] == [(5, "foul!")]
    session.dispatch(Undo())
    assert session.timeline.markers.frames == [3]
    session.dispatch(RemoveMarker(3))
    assert not session.timeline.markers
    suggested = session.view.up.copy()
    session.dispatch(SetUp((0.0, 0.0, 3.0)))
    np.testing.assert_allclose(session.view.up, [0.0, 0.0, 1.0])
    session.dispatch(Undo())
    np.testing.assert_allclose(session.view.up, suggested)


def test_everything_is_there_when_the_project_is_opened_again(session, make_session):
    session.dispatch(AddEdit(Hide(), BOX, Scope(2), is_inverted=True, name="50 % ##"))
    session.dispatch(SetLabel("camera", "cam01", "door"))
    session.dispatch(SetUp((1.0, 0.0, 0.0)))
    session.dispatch(PutMarker(2, "jump"))
    before = session.edits
    session.close()
    again = make_session()
    assert again.edits == before
    assert again.edits.label("camera", "cam01") == "door"
    assert again.timeline.markers.frames == [2]
    np.testing.assert_allclose(again.view.up, [1.0, 0.0, 0.0])


def test_what_is_selected_is_edited_and_gone_from_the_selection(session):
    session.dispatch(AddEdit(Delete()))
    assert [notice.detail for notice in session.notices] == ["Nothing is selected."]
    rows = RowSet("origin", 2, "residual")
    session.selecting.select(Selection(((rows, np.array([3, 5, 9])),)))
    session.dispatch(AddEdit(Recolor(saturation=0.0)))
    assert len(session.selecting.selection) == 3
    session.dispatch(AddEdit(Hide(), is_inverted=True))
    assert len(session.selecting.selection) == 3
    session.dispatch(AddEdit(Delete(), scope=Scope(2, 3)))
    assert len(session.selecting.selection) == 0
    assert session.history.past == (
        "recolour 3 Gaussians of clip 2",
        "isolate 3 Gaussians of clip 2",
        "delete 3 Gaussians of clip 2",
    )
    assert Selection.of_target(session.edits.edits[-1].target).clip_indices == (2,)
