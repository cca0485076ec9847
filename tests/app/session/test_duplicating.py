"""Copies through the session: named steps, drags that are one step, undo to the last digit."""

from __future__ import annotations

from dataclasses import replace

import pytest
from msgspec import structs

from app.document.storing.stored_document import plain_document
from app.session.duplicating.copy_commands import ChangeCopy, DuplicateObject, MakeCrowd, RemoveCopies, SwitchCopies
from app.session.editing.edit_commands import Redo, Undo
from engine.editing.actions import Transform
from engine.editing.copies.object_copy import ObjectCopy
from engine.editing.scene_object import SceneObject

COPY = ObjectCopy(0, "", 1, Transform((1.0, 0.0, 0.0)))


@pytest.fixture
def session(make_session):
    found = make_session()
    document = replace(found.document.content, objects=(SceneObject(1, "one"),))
    found.document.change(document, "object")
    return found


def test_every_step_has_a_name_and_goes_back_and_forth(session):
    documents = [plain_document(session.document.content)]
    for command in (
        DuplicateObject(COPY),
        DuplicateObject(COPY, n_times=3),
        MakeCrowd(COPY, 2, 2, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 2.0),
        SwitchCopies((2, 3, 4), is_on=False),
        ChangeCopy(structs.replace(COPY, copy_id=1, name="one 1", speed=2.0)),
        RemoveCopies((5,)),
        RemoveCopies((1, 2, 3)),
    ):
        session.dispatch(command)
        documents.append(plain_document(session.document.content))
    assert session.history.past[1:] == (
        "duplicate: one",
        "duplicate 3 times: one",
        "crowd of 3: one",
        "switch off 3 copies",
        "change copy: one 1",
        "remove copy: one copy 5",
        "remove 3 copies",
    )
    assert [copy.group for copy in session.edits.copies] == ["one group 1", "one group 2", "one group 2"]
    for document in documents[-2::-1]:
        session.dispatch(Undo())
        assert plain_document(session.document.content) == document
    for document in documents[1:]:
        session.dispatch(Redo())
        assert plain_document(session.document.content) == document
    assert len(session.notices) == 0


def test_a_drag_is_one_step_and_nothing_changed_is_none(session):
    session.dispatch(DuplicateObject(COPY))
    (copy,) = session.edits.copies
    n_steps = len(session.history.past)
    session.dispatch(ChangeCopy(copy))
    assert len(session.history.past) == n_steps
    for x in (1.5, 2.0, 2.5):
        copy = structs.replace(copy, transform=Transform((x, 0.0, 0.0)))
        session.dispatch(ChangeCopy(copy, gesture=4))
    assert len(session.history.past) == n_steps + 1
    session.dispatch(Undo())
    assert session.edits.copies[0].transform == COPY.transform


def test_what_is_refused_becomes_a_notice(session):
    session.dispatch(DuplicateObject(structs.replace(COPY, object_id=8)))
    session.dispatch(RemoveCopies((4,)))
    assert session.edits.copies == ()
    assert [notice.title for notice in session.notices] == ["The edit cannot be made"] * 2
