"""Filling behind an edit through the session: on a thread, one step of the history, and nothing where it changed."""

from __future__ import annotations

import pytest
from msgspec import structs

from app.session.editing.edit_commands import AddEdit, ChangeEdit, FillBehind, Redo, Undo
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Box, Fill
from engine.editing.fills.fill import fill_key
from engine.errors import ProjectError
from tests.app.conftest import poll_until

BOX = Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))


@pytest.fixture
def session(make_session):
    made = make_session()
    made.filling._fill = lambda opened, stack, edit_id, report: _with_fill(stack.edits[edit_id - 1])
    made.dispatch(AddEdit(Delete(), BOX))
    return made


def _with_fill(edit):
    return structs.replace(edit, fill=Fill(fill_key(edit)))


def test_a_fill_is_one_step_that_goes_and_comes(session):
    session.dispatch(FillBehind(1))
    poll_until(session, lambda: session.edits.edits[0].fill is not None)
    assert session.history.undo == "fill behind: delete box 1 × 1 × 1"
    filled = session.edits.edits
    session.dispatch(Undo())
    assert session.edits.edits[0].fill is None
    session.dispatch(Redo())
    assert session.edits.edits == filled


def test_where_the_edit_changed_meanwhile_there_is_a_notice(session):
    session.dispatch(FillBehind(1))
    edit = session.edits.edits[0]
    session.dispatch(ChangeEdit(structs.replace(edit, target=Box(BOX.center, (0.9, 0.9, 0.9)))))
    poll_until(session, lambda: len(session.notices) > 0)
    assert session.edits.edits[0].fill is None


def test_failures_are_notices(session):
    def fail(*_):
        raise ProjectError("Nothing is trained.")

    session.filling._fill = fail
    session.dispatch(FillBehind(1))
    poll_until(session, lambda: len(session.notices) > 0)
    (notice,) = session.notices
    assert "Nothing is trained." in f"{notice.title} {notice.detail}"
    assert session.edits.edits[0].fill is None


def test_only_what_takes_something_away_is_filled(session):
    session.dispatch(AddEdit(Expose(1.0), BOX))
    session.dispatch(FillBehind(2))
    assert len(session.notices) == 1
