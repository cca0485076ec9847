"""Deletions applied permanently from the window: asked first, done by jobs, taken back by versions and undo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.project.clips.clip_versions import list_versions
from app.project.project import Project
from app.session.clips.clip_commands import ApplyDeletions
from app.session.clips.clip_questions import DeletionsQuestion
from app.session.editing.edit_commands import AddEdit, Undo
from app.session.projects.project_commands import OpenProject
from app.session.session import Session
from engine.clip_files.clip_state import read_clip_state
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Picked, PickedRows
from engine.editing.lost_picks import LostPicks
from engine.editing.picks import pack_rows
from engine.errors import DiskError
from tests.app.conftest import poll_until
from tests.app.residuals.conftest import make_project


@pytest.fixture
def session(make_session, tmp_path: Path) -> Session:
    made = make_session(is_open=False)
    made.dispatch(OpenProject(make_project(tmp_path / "made")))
    poll_until(made, lambda: made.opened is not None, what="the project")
    return made


def project_of(session: Session) -> Project:
    assert session.opened is not None
    return session.opened.project


def picked(session: Session, numbers: np.ndarray) -> Picked:
    header = read_clip_state(project_of(session).clip_path(0)).header
    return Picked((PickedRows(0, header.fingerprint, "static", pack_rows(numbers)),))


def n_static(session: Session) -> int:
    found = read_clip_state(project_of(session).clip_path(0)).anchors["static"].own
    return 0 if found is None else len(found)


@pytest.mark.slow
def test_it_is_asked_first_and_then_done(session: Session):
    session.dispatch(AddEdit(Delete(), picked(session, np.arange(4))))
    session.dispatch(AddEdit(Expose(1.0), picked(session, np.arange(3, 6))))
    session.dispatch(ApplyDeletions())
    poll_until(session, lambda: session.question is not None, what="the question")
    assert session.question == DeletionsQuestion(n_anchors=8, n_clips=2, n_untrained=0)
    before = n_static(session)
    session.dispatch(ApplyDeletions(is_confirmed=True))
    poll_until(session, lambda: len(session.edits.edits) == 1, what="the end")
    assert [type(edit.action) for edit in session.edits.edits] == [Expose]
    assert n_static(session) == before - 4
    assert session.history.undo == "apply deletions permanently"
    project = project_of(session)
    assert [len(list_versions(project, index)) for index in (0, 1)] == [1, 1]
    assert [session.clip_states[index].state for index in (0, 1)] == ["trained", "trained"]
    session.dispatch(Undo())
    assert [type(edit.action) for edit in session.edits.edits] == [Delete, Expose], "in one step"


def test_what_cannot_be_applied_is_a_notice(session: Session):
    session.dispatch(AddEdit(Expose(1.0), picked(session, np.arange(2))))
    session.dispatch(ApplyDeletions())
    poll_until(session, lambda: bool(len(session.notices)), what="the notice")
    assert "no active edit deletes" in next(iter(session.notices)).detail
    assert session.question is None


def test_edits_that_change_meanwhile_stop_it(session: Session):
    session.dispatch(AddEdit(Delete(), picked(session, np.arange(4))))
    before = n_static(session)
    session.dispatch(ApplyDeletions(is_confirmed=True))
    session.dispatch(AddEdit(Expose(1.0), picked(session, np.arange(2))))
    poll_until(session, lambda: bool(len(session.notices)), what="the notice")
    assert "changed in the meantime" in next(iter(session.notices)).detail
    assert n_static(session) == before
    assert not (project_of(session).folder / "exchange").exists()
    assert len(session.edits.edits) == 2


def test_edits_that_have_lost_their_picks_are_named(session: Session):
    session.dispatch(AddEdit(Expose(1.0), picked(session, np.arange(2))))
    other = Picked((PickedRows(1, "as it was before", "residual", pack_rows(np.arange(2))),))
    session.dispatch(AddEdit(Expose(1.0), other))
    session.poll()
    assert session.edits.lost == (LostPicks(2, (1,), is_all=True),)


@pytest.mark.slow
def test_clips_stay_as_long_as_the_disk_does_not_keep_what_was_edited(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only with the numbers that picks get do edits fit the new clips."""
    session.dispatch(AddEdit(Delete(), picked(session, np.arange(4))))
    session.dispatch(AddEdit(Expose(1.0), picked(session, np.arange(3, 6))))
    session.document.settle()
    before = n_static(session)

    def refuse(*arguments: object) -> None:
        raise DiskError("The project could not be written.")

    monkeypatch.setattr(project_of(session).store, "write", refuse)
    session.dispatch(ApplyDeletions(is_confirmed=True))
    poll_until(session, lambda: any("saved yet" in notice.detail for notice in session.notices), what="the notice")
    assert n_static(session) == before
    assert not (project_of(session).folder / "exchange").exists()
