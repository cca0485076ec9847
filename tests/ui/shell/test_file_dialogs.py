"""Dialogs about the files of a project, driven by pointer and keys: what each answer sends."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image
from pyglet.window import key

from app.document.storing.recovery import Recovery
from app.project.opening.project_choices import ProjectChoices
from app.session.commands import CloseQuestion
from app.session.files.file_commands import AskSaveAs, CancelSaveAs, SaveProjectAs, ShowProjectFolder
from app.session.files.file_questions import (
    SAVING,
    RecoveryQuestion,
    RelocationQuestion,
    SaveAsQuestion,
    SavingQuestion,
)
from app.session.projects.project_commands import OpenCapture, OpenProject
from app.status import JobStatus
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.panels.state import EDIT
from ui.shell.dialogs.dialogs import RELOCATE

pytestmark = [pytest.mark.gl, pytest.mark.slow]

FOLDER = Path("/projects/100 %s ##1")
PROBLEM = "The journal of the project is damaged. Line 14 is damaged (its content does not fit its checksum)."
RECOVERY = Recovery(FOLDER, PROBLEM, 212, "mark a region", False, 12, 200)


def asked(pilot: Pilot, question: object) -> Pilot:
    pilot.session.question = question
    pilot.draw(3)
    folder = os.environ.get("DIALOG_PICTURES")
    if folder:
        name = type(question).__name__ + ("2" if getattr(question, "refused", None) else "")
        Image.fromarray(pilot.picture()).save(Path(folder) / f"{name}.png")
    return pilot


@pytest.mark.parametrize(
    ("way", "answer"),
    [
        (0, OpenProject(FOLDER, ProjectChoices(is_repaired=True))),
        (1, OpenProject(FOLDER, ProjectChoices(is_journal_used=False))),
        (2, ShowProjectFolder(FOLDER)),
    ],
)
def test_a_damaged_project_offers_three_ways(pilot: Pilot, way: int, answer: object) -> None:
    asked(pilot, RecoveryQuestion(RECOVERY))
    for _ in range(way):
        pilot.key(key.DOWN)
    pilot.key(key.ENTER)
    assert pilot.sent(type(answer)) == [answer]


def test_a_way_can_be_chosen_by_the_pointer(pilot: Pilot) -> None:
    asked(pilot, RecoveryQuestion(RECOVERY))
    pilot.click("question.way1")
    pilot.click("question.yes")
    assert pilot.sent(OpenProject) == [OpenProject(FOLDER, ProjectChoices(is_journal_used=False))]


def test_a_question_outlives_panels_that_come_to_the_front(pilot: Pilot) -> None:
    asked(pilot, RecoveryQuestion(RECOVERY))
    pilot.studio.frame.ui.wanted_panel = EDIT  # as the first frames of a window bring its panels
    pilot.draw(4)
    assert pilot.sent(CloseQuestion) == []
    pilot.key(key.ENTER)
    assert pilot.sent(OpenProject) == [OpenProject(FOLDER, ProjectChoices(is_repaired=True))]


def test_where_nothing_can_be_read_only_the_folder_is_offered(pilot: Pilot) -> None:
    asked(pilot, RecoveryQuestion(Recovery(FOLDER, PROBLEM, None)))
    assert "question.way1" not in pilot.rects
    pilot.key(key.ENTER)
    assert pilot.sent(ShowProjectFolder) == [ShowProjectFolder(FOLDER)]


def test_escape_leaves_a_damaged_project_alone(pilot: Pilot) -> None:
    asked(pilot, RecoveryQuestion(RECOVERY))
    pilot.key(key.ESCAPE)
    assert pilot.session.commands[-1] == CloseQuestion()
    assert not pilot.sent(OpenProject)


def test_a_lost_capture_is_asked_for_with_the_dialog_for_folders(
    pilot: Pilot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    dialog = pilot.studio.frame.dialog
    dialog._start, dialog._text = tmp_path, str(tmp_path)
    asked(pilot, RelocationQuestion(FOLDER, Path("/captures/dance")))
    pilot.click("question.yes")
    pilot.session.question = None
    pilot.draw(3)
    assert dialog._purpose == RELOCATE
    pilot.click("open.accept")
    assert pilot.sent(OpenProject) == [OpenProject(FOLDER, ProjectChoices(capture=tmp_path))]


def test_another_capture_can_be_opened_as_such(pilot: Pilot) -> None:
    other = Path("/captures/other")
    asked(pilot, RelocationQuestion(FOLDER, Path("/captures/dance"), other))
    pilot.click("question.other")
    assert pilot.sent(OpenCapture)[-1] == OpenCapture(other, is_asking=True)


def test_a_copy_is_made_where_it_is_typed(pilot: Pilot, tmp_path: Path) -> None:
    pilot.key(key.S, modifiers=(key.LCTRL, key.LSHIFT))
    assert pilot.sent(AskSaveAs) == [AskSaveAs()]
    asked(pilot, SaveAsQuestion(FOLDER, tmp_path / "copy", 123_000_000))
    pilot.click("question.yes")
    assert pilot.sent(SaveProjectAs) == [SaveProjectAs(tmp_path / "copy")]


def test_a_folder_that_holds_something_is_not_taken(pilot: Pilot, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    asked(pilot, SaveAsQuestion(FOLDER, tmp_path, 0))
    pilot.click("question.yes")
    pilot.key(key.ENTER)
    assert not pilot.sent(SaveProjectAs)


def test_saving_shows_how_far_it_is_and_escape_ends_it(pilot: Pilot) -> None:
    pilot.session.jobs = [JobStatus(SAVING, 0.4, "0003.safetensors")]
    asked(pilot, SavingQuestion(FOLDER))
    pilot.key(key.ESCAPE)
    assert pilot.sent(CancelSaveAs)[:1] == [CancelSaveAs()]


def test_opening_for_reading_only_is_in_the_menu(
    open_pilot: Callable[..., Pilot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.studio.frame.dialog._text = str(tmp_path)
    pilot.studio.frame.ui.wishes.is_read_only = True
    pilot.draw(4)
    pilot.click("open.accept")
    assert pilot.sent(OpenCapture) == [OpenCapture(tmp_path, choices=ProjectChoices(is_read_only=True))]
