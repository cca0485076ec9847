"""Regions marked by commands: kept in the project, handed to the next training, and the words about them."""

import threading
from functools import partial

import pytest

from app.cli.cli import main
from app.document.storing.document_store import DocumentStore
from app.document.storing.stored_document import plain_document
from app.project.opening.project_access import open_project
from app.session.editing.edit_commands import Redo, Undo
from app.session.editing.mark_commands import MarkRegion, RemoveRegion
from app.session.marking import effect_text
from app.session.projects.project_commands import OpenProject
from app.session.projects.setting_commands import SetClipLength
from app.session.training.train_commands import TrainNextClip
from app.training.worker.build import build_training
from engine.errors import ProjectError
from engine.gate.regions import GateRegion, sphere_region
from tests.app.conftest import inline, poll_until
from tests.app.fakes import make_fake
from tests.app.session.test_session import train_next

BALL = sphere_region("dynamic", (0.25, -0.5, 1.0), 0.125)
OTHER = sphere_region("static", (0.0, 0.0, 0.0), 2.0)
MARK_BALL = MarkRegion("dynamic", (0.25, -0.5, 1.0), 0.125)
MARK_OTHER = MarkRegion("static", (0.0, 0.0, 0.0), 2.0)


def ready(session):
    """The session, once it has read what its project holds."""
    poll_until(session, lambda: session.regions.can_mark, what="the marked regions")
    return session


def on_disk(session) -> tuple[GateRegion, ...]:
    session.document.settle()
    return open_project(session.project.folder, is_writable=False).document.regions


def building(job, store, report, *, monkeypatch, seen):
    """Builds the training as the program does, but for the training itself: notes its regions, trains the fake."""
    with monkeypatch.context() as patch:
        patch.setattr("app.training.worker.build.warm_up_reporting", lambda report: None)
        patch.setattr(
            "engine.training.clip_training.ClipTraining", lambda *_, regions, **__: seen.append(tuple(regions))
        )
        build_training(job, store, report)
    return make_fake(job, store, report)


def test_a_mark_reaches_the_file_and_the_next_training(make_session, monkeypatch):
    seen = []
    session = ready(make_session(make_training=partial(building, monkeypatch=monkeypatch, seen=seen)))
    session.dispatch(SetClipLength(3))
    train_next(session)
    session.dispatch(MARK_BALL)
    assert session.regions.regions == (BALL,)  # at once, not when the disk is done
    train_next(session)
    assert seen == [(), (BALL,)]
    assert on_disk(session) == (BALL,)
    assert list(session.notices) == [n for n in session.notices if n.kind == "info"]


def test_a_training_starts_when_what_was_marked_just_before_is_on_disk(make_session, monkeypatch):
    seen, keep = [], DocumentStore.write

    def launch(job, project):
        seen.append(open_project(project.folder, is_writable=False).document.regions)
        return inline(job, project)

    def slowly(store, events, history):
        threading.Event().wait(0.5)
        keep(store, events, history)

    session = ready(make_session(launch=launch))
    monkeypatch.setattr(DocumentStore, "write", slowly)
    session.dispatch(MARK_BALL)
    session.dispatch(TrainNextClip())
    assert seen == [(BALL,)]


def test_window_and_command_line_keep_the_same_file(make_session, capsys):
    session = ready(make_session())
    session.dispatch(MARK_OTHER)
    session.dispatch(MARK_BALL)
    session.close()
    folder = str(session.project.folder)
    by_window = plain_document(open_project(folder, is_writable=False).document)
    assert main(["gate", folder, "--forget"]) == 0
    sphere = ["--static-sphere", "0", "0", "0", "2", "--dynamic-sphere", "0.25", "-0.5", "1", "0.125"]
    assert main(["gate", folder, *sphere]) == 0
    assert plain_document(open_project(folder, is_writable=False).document) == by_window
    said = capsys.readouterr().out
    assert "static in the sphere of 2 around (0, 0, 0)" in said
    assert "Marks apply to clips trained from now on." in said


def test_regions_come_back_when_the_project_is_opened_again(make_session):
    first = ready(make_session())
    first.dispatch(MARK_BALL)
    first.close()  # right away: nothing marked may be lost
    again = ready(make_session())
    assert again.regions.regions == (BALL,)
    assert again.history.undo == "mark a region"
    again.dispatch(Undo())
    assert again.regions.regions == ()


def test_removing_and_taking_back(make_session):
    session = ready(make_session())
    session.dispatch(Undo())  # nothing to take back
    for command, expected in (
        (MARK_BALL, (BALL,)),
        (MARK_OTHER, (BALL, OTHER)),
        (RemoveRegion(0), (OTHER,)),
        (Undo(), (BALL, OTHER)),
        (Undo(), (BALL,)),
        (MARK_OTHER, (BALL, OTHER)),
        (Undo(), (BALL,)),
        (Undo(), ()),
    ):
        assert bool(session.history.undo) == (command != MARK_BALL)
        session.dispatch(command)
        assert session.regions.regions == expected
        assert on_disk(session) == expected
    session.dispatch(Undo())
    assert session.regions.regions == ()
    assert len(session.notices) == 0


def test_what_was_taken_back_is_done_again_until_something_else_is(make_session):
    session = ready(make_session())
    session.dispatch(Redo())  # nothing was taken back
    for command, expected, can_redo in (
        (MARK_BALL, (BALL,), False),
        (MARK_OTHER, (BALL, OTHER), False),
        (Undo(), (BALL,), True),
        (Undo(), (), True),
        (Redo(), (BALL,), True),
        (Redo(), (BALL, OTHER), False),
        (Undo(), (BALL,), True),
        (RemoveRegion(0), (), False),
        (Undo(), (BALL,), True),
    ):
        session.dispatch(command)
        assert session.regions.regions == expected
        assert bool(session.history.redo) == can_redo
        assert on_disk(session) == expected
    assert len(session.notices) == 0


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (MarkRegion("static", (0.0, 0.0, 0.0), -1.0), "radius"),
        (MarkRegion("static", (0.0, float("nan"), 0.0), 1.0), "not finite"),
        (MarkRegion("wobbly", (0.0, 0.0, 0.0), 1.0), "wobbly"),
        (RemoveRegion(1), "There is no region 2; 1 are marked"),
        (RemoveRegion(-1), "There is no region 0"),
    ],
)
def test_what_cannot_be_is_told_and_changes_nothing(make_session, command, expected):
    session = ready(make_session())
    session.dispatch(MARK_BALL)
    session.dispatch(command)
    assert expected in session.notices[0].detail
    assert session.regions.regions == on_disk(session) == (BALL,)


def test_without_a_capture_there_is_nothing_to_mark_in(make_session):
    session = make_session(is_open=False)
    assert not session.regions.can_mark
    assert "Open a capture" in session.regions.why_not
    session.dispatch(MARK_BALL)
    assert session.notices[0].title == "The region cannot be marked"
    assert session.regions.regions == ()


def test_a_project_that_another_program_writes_to_is_left_alone(make_session, capsys):
    first = ready(make_session())
    first.dispatch(MARK_BALL)
    assert on_disk(first) == (BALL,)
    second = make_session()
    poll_until(second, lambda: second.regions.regions == (BALL,), what="the regions of the other program")
    assert not second.regions.can_mark
    assert "read-only" in second.regions.why_not
    n_notices = len(second.notices)
    for command in (MARK_OTHER, RemoveRegion(0)):
        second.dispatch(command)
    assert [notice.kind for notice in second.notices][n_notices:] == ["error", "error"]
    assert second.regions.regions == on_disk(second) == (BALL,)
    assert main(["gate", str(first.project.folder), "--static-sphere", "0", "0", "0", "1"]) == 2
    assert "open for writing" in capsys.readouterr().err


def test_what_could_not_be_kept_is_not_shown_as_if_it_were(make_session, monkeypatch):
    session = ready(make_session())
    session.dispatch(MARK_OTHER)
    assert on_disk(session) == (OTHER,)

    def refuse(*_):
        raise ProjectError("The project could not be saved (No space left on device).", hint="Free some space.")

    monkeypatch.setattr(DocumentStore, "write", refuse)
    session.dispatch(MARK_BALL)
    poll_until(session, lambda: len(session.notices) > 0 and session.regions.can_mark, what="a notice")
    assert "No space left" in session.notices[0].detail
    assert session.regions.regions == (OTHER,)


def test_it_is_said_which_clips_a_mark_reaches(make_session):
    session = ready(make_session())
    session.dispatch(SetClipLength(3))
    before = session.regions.effect
    train_next(session)
    assert "Clip 0" in session.regions.effect
    assert before == effect_text([], gate="hull")
    assert "0 to 2, 5" in effect_text([5, 0, 1, 2], gate="hull")
    assert "gate=off" in effect_text([], gate="off")


def test_another_capture_brings_its_own_regions(make_session, tmp_path, capture_folder):
    session = ready(make_session())
    session.dispatch(MARK_BALL)
    other = ready(make_session(name="q"))
    other.dispatch(MARK_OTHER)
    folder = other.project.folder
    other.close()
    session.dispatch(OpenProject(folder))
    poll_until(session, lambda: session.project.folder == folder and session.regions.can_mark, what="the other one")
    assert session.regions.regions == (OTHER,)
    session.dispatch(Undo())
    assert session.regions.regions == ()
    assert open_project(tmp_path / "p", is_writable=False).document.regions == (BALL,)
