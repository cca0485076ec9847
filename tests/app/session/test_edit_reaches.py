"""Edits that act only in some frames, or in none, through the session on a trained project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.session.editing.edit_commands import AddEdit
from app.session.editing.selection import Selection
from app.session.projects.project_commands import OpenProject
from app.session.session import Session
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import look_at_clip
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Scope
from engine.editing.gaussian_rows import RowSet
from tests.app.conftest import poll_until
from tests.app.residuals.conftest import make_project


@pytest.fixture
def session(make_session, tmp_path: Path) -> Session:
    """Two clips of three frames, both trained."""
    made = make_session(is_open=False)
    made.dispatch(OpenProject(make_project(tmp_path / "made")))
    poll_until(made, lambda: made.opened is not None, what="the project")
    return made


def select_of(session: Session, clip_index: int, role: str) -> None:
    assert session.opened is not None
    header = look_at_clip(session.opened.project.clip_path(clip_index))
    assert isinstance(header, ClipHeader)
    rows = RowSet(header.origin, clip_index, role)
    session.selecting.select(Selection(((rows, np.arange(4)),)))


def test_the_clips_have_their_names(session: Session) -> None:
    first, second = session.edits.clips
    assert (first.start, first.stop, second.start, second.stop) == (0, 3, 3, 6)
    assert first.inherits == ""
    assert second.inherits == first.origin != second.origin


def test_an_edit_outside_of_the_frames_of_its_selection_is_refused(session: Session) -> None:
    select_of(session, 1, "residual")
    session.dispatch(AddEdit(Delete(), scope=Scope(0, 3)))
    assert session.edits.edits == ()
    [notice] = session.notices
    assert "The edit can never act (frames 0-2): the selection exists in frames 3-5 only." in notice.detail
    assert len(session.selecting.selection) == 4, "it can be made in other frames"


def test_the_stack_knows_where_its_edits_act(session: Session) -> None:
    select_of(session, 1, "residual")
    session.dispatch(AddEdit(Expose(1.0)))
    select_of(session, 0, "static")
    session.dispatch(AddEdit(Expose(1.0)))
    session.poll()
    assert [session.edits.reach(edit.edit_id).acts for edit in session.edits.edits] == [((3, 6),), ((0, 6),)]
