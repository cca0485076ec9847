"""Volumes that follow objects, through the session, on the command line and in scripts, on a trained project."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from app.project.opening.project_access import open_project
from app.scripting.scripted_project import open_scripted
from app.session.commands import CancelJob
from app.session.editing.edit_commands import AddEdit, RemoveEdit, Undo
from app.session.objects.follow_commands import FollowObject
from app.session.projects.project_commands import OpenProject
from app.session.session import Session
from engine.editing.actions import Delete
from engine.editing.edit import Box, KeyedVolume, Sphere, VolumeKey
from engine.editing.volumes.keyed_volume import volume_at
from engine.errors import ProjectError
from tests.app.conftest import poll_until
from tests.app.residuals.conftest import make_project

BALL = Sphere((0.5, 0.5, 0.5), 0.4)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two clips of three frames, both trained, with an object in the first one at least."""
    made = make_project(tmp_path / "made")
    with open_scripted(made) as project:
        project.make_object("ball", project.select(volume=BALL, frame_index=1), 1)
        project.apply_edit(Delete(), BALL)
    return made


@pytest.fixture
def session(make_session, folder: Path) -> Session:
    made = make_session(is_open=False)
    made.dispatch(OpenProject(folder))
    poll_until(made, lambda: made.opened is not None, what="the project")
    return made


def settle(session: Session) -> None:
    poll_until(session, lambda: not session.poll() and not session.jobs)


def test_an_edit_follows_an_object_in_one_step(session):
    n_steps = len(session.history.past)
    session.dispatch(FollowObject(1, 1))
    [job] = session.jobs
    assert (job.name, job.can_cancel) == ("Following ball", True)
    settle(session)
    assert not list(session.notices)
    target = session.edits.edits[0].target
    assert isinstance(target, KeyedVolume)
    assert all(isinstance(key.volume, Sphere) for key in target.keys)
    assert len(session.history.past) == n_steps + 1
    assert session.history.undo.startswith("follow ball")
    session.dispatch(Undo())
    assert session.edits.edits[0].target == BALL


def test_it_is_given_up_by_the_user_and_by_what_happens_meanwhile(session):
    may_end = threading.Event()

    def slow(opened, one, target, report):
        while not may_end.wait(0.01):
            report(1, 2)
        return KeyedVolume((VolumeKey(0.0, BALL),))

    session.following.follow = slow
    session.dispatch(FollowObject(1, 1))
    session.dispatch(CancelJob("Following ball"))
    settle(session)
    assert session.edits.edits[0].target == BALL
    session.dispatch(FollowObject(1, 1))
    session.dispatch(RemoveEdit(1))
    may_end.set()
    settle(session)
    assert session.edits.edits == ()
    assert not list(session.notices)


def test_what_cannot_be_followed_is_told(session):
    for command, words in ((FollowObject(9, 1), "no object 9"), (FollowObject(1, 9), "no edit 9")):
        session.dispatch(command)
        notice = list(session.notices)[-1]
        assert notice.title == "The volume cannot follow the object"
        assert words in notice.detail

    def fails(opened, one, target, report):
        raise ProjectError("It went wrong.")

    session.following.follow = fails
    session.dispatch(AddEdit(Delete(), BALL))
    session.dispatch(FollowObject(1, 1))
    settle(session)
    assert "It went wrong." in list(session.notices)[-1].detail


def test_the_command_line_does_the_same(run, folder):
    code, out, err = run("edit", folder, "follow", "--object", "ball", "--edit", 1, "--json")
    assert (code, err) == (0, "")
    [edit] = open_project(folder, is_writable=False).document.edits
    assert isinstance(edit.target, KeyedVolume)
    assert '"keyed"' in out
    for arguments, words in (
        (("follow", "--edit", 1), "follow needs --object."),
        (("follow", "--object", "ball"), "follow needs --edit."),
        (("hide", "--edit", 1), "--edit is given without follow."),
        (("follow", "--object", "ball", "--edit", 1, "--on", 1), "--on is given with follow."),
        (("follow", "--object", "ball", "--edit", 1, "--frame", 2), "is given with frames"),
        (("follow", "--object", "cat", "--edit", 1), "There is no object called 'cat'"),
        (("follow", "--object", "ball", "--edit", 7), "There is no edit 7"),
    ):
        code, _, err = run("edit", folder, *arguments)
        assert code != 0
        assert words in err


def test_in_a_script_the_volume_is_around_the_object_where_it_is(folder):
    told: list[float] = []
    with open_scripted(folder) as project:
        edit = project.apply_edit("expose", stops=1.0)
        edit = project.follow_object("ball", edit.edit_id, on_progress=told.append)
        assert told == sorted(told)
        assert told[-1] == 1.0
        assert isinstance(edit.target, KeyedVolume)
        assert edit.target == project.edits[-1].target
        box = volume_at(edit.target, 1)
        assert isinstance(box, Box), "an edit without a volume gets a box"
        project.undo()
        assert not isinstance(project.edits[-1].target, KeyedVolume)
