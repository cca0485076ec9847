"""Objects through the session on a trained project, with a search that tests can hold up."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from app.document.history import ObjectFound
from app.session.commands import CancelJob
from app.session.editing.edit_commands import AddEdit, Redo, Undo
from app.session.editing.selection import Selection
from app.session.objects.object_commands import (
    CorrectObject,
    FindObject,
    MakeObject,
    RecolourObject,
    RemoveObject,
    RenameObject,
    SetObjectSpan,
    SetObjectTrained,
)
from app.session.projects.project_commands import OpenProject
from app.session.session import Session
from app.session.showing.look_commands import SetFrame
from engine.capture.exclusions import PaintedMask, Stroke
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import look_at_clip
from engine.editing.actions import Expose
from engine.editing.edit import ObjectTarget
from engine.editing.gaussian_rows import RowSet
from engine.editing.picks import unpack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from engine.errors import ProjectError
from tests.app.conftest import poll_until
from tests.app.residuals.conftest import make_project

MASK = PaintedMask("cam", 0, 3, (Stroke(((0.5, 0.5),), 0.1),), 1)


class Finder:
    """Finds an object in both clips: what its first seed holds in the first, and nothing in the second."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.asked: list[SceneObject] = []
        self.may_end = threading.Event()
        self.may_end.set()
        self.fails = False

    def __call__(self, opened, one: SceneObject, report) -> tuple[ObjectInClip, ...]:
        self.asked.append(one)
        report(1, 2)
        while not self.may_end.wait(0.01):
            report(1, 2)
        report(2, 2)
        if self.fails:
            raise ProjectError("It went wrong.")
        first, second = self._session.edits.clips
        return (
            ObjectInClip(0, 3, one.seeds[0].added, ((0, 3),), 1.0, "", first.origin),
            ObjectInClip(3, 6, (), (), 1.0, "gone", second.origin),
        )


@pytest.fixture
def session(make_session, tmp_path: Path) -> Session:
    """Two clips of three frames, both trained."""
    made = make_session(is_open=False)
    made.objects.find = Finder(made)
    made.dispatch(OpenProject(make_project(tmp_path / "made")))
    poll_until(made, lambda: made.opened is not None, what="the project")
    return made


@pytest.fixture
def finder(session: Session) -> Finder:
    assert isinstance(session.objects.find, Finder)
    return session.objects.find


def select_of(session: Session, clip_index: int, role: str, n: int = 4) -> None:
    assert session.opened is not None
    header = look_at_clip(session.opened.project.clip_path(clip_index))
    assert isinstance(header, ClipHeader)
    session.selecting.select(Selection(((RowSet(header.origin, clip_index, role), np.arange(n)),)))


def make(session: Session, name: str = "") -> None:
    session.dispatch(SetFrame(1))
    select_of(session, 0, "static")
    session.dispatch(MakeObject(name))


def settle(session: Session) -> None:
    """Poll until everything was looked for."""
    poll_until(session, lambda: not session.poll() and session.objects.searched is None and not session.jobs)


def one_of(session: Session) -> SceneObject:
    [one] = session.edits.objects
    return one


def test_an_object_is_there_at_once_and_found_a_moment_later_in_one_step(session, finder):
    finder.may_end.clear()
    make(session, "ball")
    one = one_of(session)
    assert [(clip.start, clip.stop, clip.origin) for clip in one.clips] == [(0, 3, "")]
    assert not len(session.selecting.selection), "the object has taken its place"
    poll_until(session, lambda: any(job.done for job in session.jobs))
    [job] = session.jobs
    assert (job.name, job.can_cancel) == ("Finding ball", True)
    finder.may_end.set()
    settle(session)
    assert [clip.doubt for clip in one_of(session).clips] == ["", "gone"]
    assert session.history.past == ("make ball",)
    session.dispatch(Undo())
    assert session.edits.objects == ()
    session.dispatch(Redo())
    settle(session)
    assert len(one_of(session).clips) == 2
    assert len(finder.asked) == 1, "nothing is left to be looked for"
    assert not list(session.notices)


def test_one_undo_takes_back_one_step_though_others_were_made_meanwhile(session, finder):
    finder.may_end.clear()
    make(session)
    session.dispatch(AddEdit(Expose(1.0), ObjectTarget(1)))
    finder.may_end.set()
    settle(session)
    assert session.history.past == ("make object 1", "expose object 1 by +1 EV")
    session.dispatch(Undo())
    assert len(one_of(session).clips) == 2
    session.dispatch(Undo())
    assert session.document.content.objects == ()


def test_a_result_for_other_seeds_is_dropped_and_the_search_begins_anew(session, finder):
    finder.may_end.clear()
    make(session)
    poll_until(session, lambda: len(finder.asked) == 1)
    select_of(session, 0, "static", n=9)
    session.dispatch(CorrectObject(1, adds=True))
    assert unpack_rows(one_of(session).clips[0].sets[0].rows).tolist() == list(range(9))
    finder.may_end.set()
    settle(session)
    assert [len(one.seeds) for one in finder.asked] == [1, 2]
    assert session.history.past == ("make object 1", "add to object 1")
    session.dispatch(Undo())
    settle(session)
    one = one_of(session)
    assert len(one.seeds) == 1
    assert one.clips[1:] == () or len(one.clips) == 2


def test_a_search_can_be_given_up_and_asked_for_again(session, finder):
    finder.may_end.clear()
    make(session, "ball")
    poll_until(session, lambda: bool(finder.asked))
    session.dispatch(CancelJob("Finding ball"))
    settle(session)
    assert [clip.origin for clip in one_of(session).clips] == [""], "it stays where it was selected"
    finder.may_end.set()
    for _ in range(5):
        session.poll()
    assert len(finder.asked) == 1, "it does not begin again on its own"
    session.dispatch(FindObject(1))
    settle(session)
    assert len(one_of(session).clips) == 2
    assert session.history.past == ("make ball",)


def test_a_search_that_fails_is_told_once(session, finder):
    finder.fails = True
    make(session, "ball")
    settle(session)
    assert [notice.title for notice in session.notices] == ["ball could not be found"]
    assert len(finder.asked) == 1


def test_a_search_ends_where_its_object_is_removed(session, finder):
    finder.may_end.clear()
    make(session)
    session.dispatch(AddEdit(Expose(1.0), ObjectTarget(1)))
    poll_until(session, lambda: bool(finder.asked))
    session.dispatch(RemoveObject(1))
    settle(session)
    assert session.edits.objects == () == session.edits.edits
    assert session.history.undo == "remove object 1 and 1 edit"
    finder.may_end.set()
    session.dispatch(Undo())
    settle(session)
    assert len(one_of(session).clips) == 2, "it is looked for where it is there again"


def test_a_clip_that_is_another_now_is_looked_at_again_without_a_step(session, finder):
    make(session)
    settle(session)
    one = one_of(session)
    known = (one.clips[0], ObjectInClip(3, 6, origin="before"))
    session.document.found(ObjectFound(1, one.seeds, known))
    settle(session)
    assert len(finder.asked) == 2
    assert one_of(session).clips[1].origin == session.edits.clips[1].origin
    assert session.history.past == ("make object 1",)


def test_nothing_is_looked_for_on_its_own_while_something_trains(session, finder):
    finder.may_end.clear()
    make(session)
    poll_until(session, lambda: bool(finder.asked))
    session.objects._is_training = lambda: True
    session.dispatch(RemoveObject(1))
    session.dispatch(Undo())
    for _ in range(5):
        session.poll()
    assert len(finder.asked) == 1
    session.objects._is_training = lambda: False
    finder.may_end.set()
    settle(session)
    assert len(finder.asked) == 2


def test_other_values_are_named_steps(session):
    make(session)
    settle(session)
    session.dispatch(RenameObject(1, "ball"))
    session.dispatch(RecolourObject(1, (0.1, 0.2, 0.3), gesture=1))
    session.dispatch(RecolourObject(1, (0.1, 0.2, 0.4), gesture=1))
    session.dispatch(SetObjectSpan(1, 1, 4))
    session.objects.mask = lambda opened, one, report: (MASK,)
    session.dispatch(SetObjectTrained(1, is_trained=False))
    settle(session)
    assert session.exclusions.masks == (MASK,)
    session.dispatch(RenameObject(1, "ball"))
    assert session.history.past == (
        "make object 1",
        "rename object 1",
        "change the colour of ball",
        "change the frames of ball",
        "train without ball",
    )
    session.dispatch(SetObjectTrained(1, is_trained=True))
    assert session.exclusions.masks == ()
    assert session.history.undo == "train with ball"
    for _ in range(6):
        session.dispatch(Undo())
    assert session.edits.objects == ()


def test_what_cannot_be_is_said_and_changes_nothing(session):
    session.dispatch(MakeObject())
    session.dispatch(SetFrame(1))
    select_of(session, 1, "residual")
    session.dispatch(MakeObject())
    session.dispatch(CorrectObject(7, adds=False))
    session.dispatch(FindObject(7))
    session.dispatch(SetObjectSpan(7, 0, 1))
    assert [notice.title for notice in session.notices] == ["The object cannot be changed"] * 5
    assert session.notices[1].detail.startswith("Nothing of the selection exists in frame 1.")
    assert session.history.past == ()
