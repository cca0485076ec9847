"""Projects that do not open as they are: damaged ones, moved captures, and those that are only looked at."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from app.document.storing.replay import journal_path
from app.project.opening.project_access import open_project
from app.project.opening.project_choices import ProjectChoices
from app.session.editing.edit_commands import Redo, Undo
from app.session.editing.mark_commands import MarkRegion
from app.session.files.file_commands import AskSaveAs, CancelSaveAs, SaveProjectAs
from app.session.files.file_questions import RecoveryQuestion, RelocationQuestion, SaveAsQuestion, SavingQuestion
from app.session.projects.project_commands import OpenCapture, OpenProject
from tests.app.conftest import poll_until, write_capture

MARKS = [MarkRegion("dynamic", (float(i), 0.0, 0.0), 0.5) for i in range(4)]


@pytest.fixture
def together(tmp_path: Path, make_session) -> Path:
    """A folder with a capture and its project, in which four regions were marked; not closed, as after a kill."""
    folder = tmp_path / "together"
    write_capture(folder / "capture")
    session = make_session(is_open=False, name="together/project")
    session.dispatch(OpenCapture(folder / "capture"))
    poll_until(session, lambda: session.regions.can_mark)
    for mark in MARKS:
        session.dispatch(mark)
        session.document.settle()
    shutil.copytree(folder, tmp_path / "killed", ignore=shutil.ignore_patterns("lock", ".lock"))
    return tmp_path / "killed"


def opened(make_session, command):
    session = make_session(is_open=False)
    session.dispatch(command)
    poll_until(session, lambda: session.project is not None or session.question is not None or bool(session.notices))
    return session


def test_what_was_edited_before_a_kill_is_there_and_said(make_session, together):
    session = opened(make_session, OpenProject(together / "project"))
    assert len(session.regions.regions) == 4
    (notice,) = [notice for notice in session.notices if "recovered" in notice.title]
    assert "4 steps were recovered from the journal, up to: mark a region." in notice.detail
    for _ in range(4):
        session.dispatch(Undo())
    assert session.regions.regions == ()
    session.close()
    again = opened(make_session, OpenProject(together / "project"))
    assert not [notice for notice in again.notices if "recovered" in notice.title]
    again.dispatch(Redo())
    assert len(again.regions.regions) == 1


def test_a_folder_with_capture_and_project_can_be_moved(make_session, together, tmp_path):
    together.rename(tmp_path / "elsewhere")
    session = opened(make_session, OpenProject(tmp_path / "elsewhere" / "project"))
    assert session.question is None
    assert session.project.settings.capture == str(tmp_path / "elsewhere" / "capture")


def damage_journal(project: Path) -> None:
    path = journal_path(project, 0)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:4], lines[4].replace(b"sphere", b"sphare"), *lines[5:]]))


def test_a_damaged_journal_is_asked_about_and_the_good_steps_are_kept(make_session, together):
    damage_journal(together / "project")
    session = opened(make_session, OpenProject(together / "project"))
    question = session.question
    assert isinstance(question, RecoveryQuestion)
    assert (question.recovery.step, question.recovery.n_replayed) == (2, 2)
    assert "Line 5 is damaged" in question.recovery.problem
    session.dispatch(OpenProject(together / "project", ProjectChoices(is_repaired=True)))
    poll_until(session, lambda: session.project is not None)
    assert len(session.regions.regions) == 2
    assert session.regions.can_mark
    assert (together / "project" / "damaged-1" / "journal" / "00000000.jsonl").is_file()


def test_a_damaged_project_can_be_looked_at_without_its_journal(make_session, together):
    damage_journal(together / "project")
    before = {path.name: path.read_bytes() for path in (together / "project").rglob("*.json*")}
    choices = ProjectChoices(is_journal_used=False)
    session = opened(make_session, OpenProject(together / "project", choices))
    assert session.regions.regions == ()
    assert "Repair it" in session.regions.why_not
    session.dispatch(MARKS[0])
    session.close()
    assert {path.name: path.read_bytes() for path in (together / "project").rglob("*.json*")} == before


def test_a_capture_that_was_moved_is_asked_for_and_taken(make_session, together, tmp_path):
    (together / "capture").rename(tmp_path / "moved")
    session = opened(make_session, OpenProject(together / "project"))
    assert session.question == RelocationQuestion(together / "project", together / "capture")
    other = write_capture(tmp_path / "other", n_frames=4)
    session.dispatch(OpenProject(together / "project", ProjectChoices(capture=other)))
    poll_until(session, lambda: session.question is not None)
    assert session.question == RelocationQuestion(together / "project", together / "capture", other)
    session.dispatch(OpenProject(together / "project", ProjectChoices(capture=tmp_path / "moved")))
    poll_until(session, lambda: session.project is not None)
    assert session.project.settings.capture == str(tmp_path / "moved")
    assert len(session.regions.regions) == 4
    session.dispatch(Undo())
    assert session.project.settings.capture == str(tmp_path / "moved"), "where the capture lies is not a step"
    session.close()
    assert open_project(together / "project", is_writable=False).settings.capture == str(tmp_path / "moved")


def test_reading_only_changes_nothing_and_says_why(make_session, together):
    before = {path.name: path.read_bytes() for path in (together / "project").rglob("*") if path.is_file()}
    session = opened(make_session, OpenProject(together / "project", ProjectChoices(is_read_only=True)))
    assert len(session.regions.regions) == 4
    assert "open it again" in session.regions.why_not
    session.dispatch(Undo())
    assert len(session.regions.regions) == 4
    assert "read-only" in session.notices[-1].detail
    assert {path.name: path.read_bytes() for path in (together / "project").rglob("*") if path.is_file()} == before
    session.dispatch(OpenProject(together / "project"))
    poll_until(session, lambda: session.regions.can_mark, what="the project, for writing")


def test_a_capture_without_a_project_is_not_opened_for_reading_only(make_session, capture_folder):
    session = opened(make_session, OpenCapture(capture_folder, choices=ProjectChoices(is_read_only=True)))
    assert session.project is None
    assert "has no project yet" in session.notices[0].detail


def test_two_windows_on_one_project(make_session, together):
    first = opened(make_session, OpenProject(together / "project"))
    second = opened(make_session, OpenProject(together / "project"))
    assert len(second.regions.regions) == 4
    assert [notice.title for notice in second.notices] == ["The project is open read-only"]
    second.dispatch(MARKS[0])
    assert "open for writing" in second.regions.why_not
    first.dispatch(MARKS[0])
    first.close()
    assert len(open_project(together / "project", is_writable=False).document.regions) == 5


def test_saving_as_goes_on_in_the_copy(make_session, together, tmp_path):
    session = opened(make_session, OpenProject(together / "project"))
    session.dispatch(AskSaveAs())
    poll_until(session, lambda: session.question is not None)
    question = session.question
    assert isinstance(question, SaveAsQuestion)
    assert question.suggestion == together / "project-2"
    session.dispatch(SaveProjectAs(question.suggestion))
    assert session.question == SavingQuestion(question.suggestion)
    poll_until(session, lambda: session.project.folder == question.suggestion)
    assert session.question is None
    session.dispatch(Undo())
    assert len(session.regions.regions) == 3
    assert len(open_project(together / "project", is_writable=False).document.regions) == 4


def test_saving_as_can_be_cancelled_and_refuses_what_is_taken(make_session, together, tmp_path, monkeypatch):
    session = opened(make_session, OpenProject(together / "project"))
    n_before = len(session.notices)
    session.dispatch(SaveProjectAs(together / "capture"))
    poll_until(session, lambda: len(session.notices) > n_before)
    assert "already taken" in session.notices[-1].detail
    assert session.question is None

    def wait(project, folder, report):
        while True:
            report(0.5, "clip")

    monkeypatch.setattr("app.session.files.project_files.copy_project", wait)
    session.dispatch(SaveProjectAs(tmp_path / "new"))
    session.dispatch(CancelSaveAs())
    poll_until(session, lambda: not session.jobs)
    assert session.question is None
    assert session.project.folder == together / "project"


def test_a_disk_that_cannot_be_written_opens_for_reading_only(make_session, together, monkeypatch):
    def refuse(self):
        from engine.errors import ProjectError

        raise ProjectError("The project folder cannot be written (Read-only file system).")

    monkeypatch.setattr("app.project.project.ProcessLock.acquire", refuse)
    session = opened(make_session, OpenProject(together / "project"))
    assert len(session.regions.regions) == 4
    assert "Read-only file system" in session.regions.why_not


def test_a_full_disk_is_said_and_nothing_is_lost_once_there_is_room(make_session, together, monkeypatch):
    session = opened(make_session, OpenProject(together / "project"))
    monkeypatch.setattr("app.session.editing.kept_document.RETRY_S", 0.01)
    write, is_full = os.write, [True]

    def refuse(handle, data):
        if is_full[0] and len(data) > 50:
            raise OSError(28, "No space left on device")
        return write(handle, data)

    monkeypatch.setattr(os, "write", refuse)
    session.dispatch(MARKS[0])
    poll_until(session, lambda: any("No space left" in notice.detail for notice in session.notices))
    session.dispatch(MARKS[1])
    session.document.settle()
    session.poll()
    assert len(session.regions.regions) == 6
    is_full[0] = False
    folder = together / "project"
    poll_until(session, lambda: len(open_project(folder, is_writable=False).document.regions) == 6)


def test_a_clock_that_was_set_back_changes_nothing(make_session, together, monkeypatch):
    import time

    monkeypatch.setattr(time, "time", lambda: 1000.0)
    session = opened(make_session, OpenProject(together / "project"))
    assert len(session.regions.regions) == 4
    session.dispatch(MARKS[0])
    session.close()
    assert len(open_project(together / "project", is_writable=False).document.regions) == 5
