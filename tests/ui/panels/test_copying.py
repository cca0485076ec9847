"""Copy as command: from menus, the palette's actions and the export dialog onto the clipboard of the window."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
from imgui_bundle import imgui
from pyglet.window import key, mouse

from app.cli.cli import main
from app.project.opening.project_access import open_project
from app.session.commands import CloseQuestion
from app.session.editing.edit_commands import AddEdit, PutMarker
from app.session.export_commands import AskExport
from app.session.projects.project_commands import OpenProject
from engine.editing.actions import Delete
from engine.editing.edit import Sphere
from tests.app.residuals.conftest import make_project
from tests.ui.pilot import Pilot
from tests.ui.real_session import draw_until, make_session
from ui.panels.actions.table import ACTIONS
from ui.panels.state import EDIT, HISTORY

pytestmark = pytest.mark.gl
NAME = 'it\'s 100 %s##\n"mine"'


@pytest.fixture
def pilot(open_pilot: Callable[..., Pilot], tmp_path: Path) -> Pilot:
    """With a trained project open."""
    project = make_project(tmp_path)
    pilot = open_pilot(make_session(tmp_path / "session"))
    pilot.session.dispatch(OpenProject(project))
    draw_until(pilot, lambda: pilot.session.capture is not None, "the project")
    pilot.draw(4)
    return pilot


@pytest.fixture(autouse=True)
def clipboard(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is put onto the clipboard: a window without a screen has none."""
    texts: list[str] = []
    monkeypatch.setattr(imgui, "set_clipboard_text", texts.append)
    return texts


def run_action(pilot: Pilot, action_id: str) -> None:
    action = next(action for action in ACTIONS if action.id == action_id)
    assert action.why_not(pilot.session, pilot.studio.frame.ui) == ""
    action.run(pilot.session, pilot.session.dispatch, pilot.studio.frame.ui)


def test_the_last_step_of_the_window_is_done_again_by_the_command(pilot, clipboard):
    session = pilot.session
    folder = session.project.folder
    no_step = next(action for action in ACTIONS if action.id == "edit.copy_command")
    assert no_step.why_not(session, pilot.studio.frame.ui) == "No step to copy yet."
    session.dispatch(AddEdit(Delete(), Sphere((0.5, -1e-5, 0.0), 0.25), name=NAME))
    made = session.document.content
    run_action(pilot, "edit.copy_command")
    line = clipboard[-1]
    run_action(pilot, "edit.copy_python")
    assert clipboard[-1].startswith("from clipgstream import Delete, Sphere, open_project\n")
    session.document.undo()
    pilot.studio.close()
    assert main(shlex.split(line)[1:]) == 0
    assert open_project(folder, is_writable=False).document == made


@pytest.mark.slow
def test_from_the_menus_of_panels(pilot, clipboard):
    session, ui = pilot.session, pilot.studio.frame.ui
    session.dispatch(AddEdit(Delete(), Sphere((0.5, 0.0, 0.0), 0.25), name=NAME))
    session.dispatch(PutMarker(2, "here"))
    for panel, row, entry, expected in (
        (EDIT, "edits.row1", "edits.menu.copy command", ["--delete", "--sphere", "0.5", "0.0", "0.0", "0.25"]),
        (HISTORY, "history.step1", "history.menu.copy command", ["--delete", "--sphere", "0.5", "0.0", "0.0", "0.25"]),
        (HISTORY, "history.step2", "history.menu.copy command", ["--put", "-"]),
    ):
        ui.show_edit("edits") if panel == EDIT else setattr(ui, "wanted_panel", panel)
        draw_until(pilot, lambda row=row: row in pilot.rects, row)
        pilot.draw(4)
        pilot.move(*pilot.rects[row].center)
        pilot.press(mouse.RIGHT)
        pilot.release(mouse.RIGHT)
        draw_until(pilot, lambda entry=entry: entry in pilot.rects, entry)
        pilot.draw(3)
        pilot.click(entry)
        pilot.draw(2)
        line = clipboard[-1].split(" <<")[0]
        assert shlex.split(line)[3 : 3 + len(expected)] == expected
        pilot.key(key.ESCAPE)
        pilot.draw(3)
        pilot.rects.pop(entry, None)


@pytest.mark.slow
def test_the_training_of_a_clip_and_an_export(pilot, clipboard):
    run_action(pilot, "train.copy_command")
    arguments = shlex.split(clipboard[-1])
    assert arguments[:2] == ["clipgstream", "train"]
    assert arguments[3:] == ["--project", str(pilot.session.project.folder), "--clips", "0:1", "--again"]
    pilot.session.dispatch(AskExport())
    draw_until(pilot, lambda: "export.copy" in pilot.rects and "export.plan" in pilot.rects, "the dialog")
    pilot.draw(20)
    pilot.click("export.copy")
    draw_until(pilot, lambda: "export.copy command" in pilot.rects, "the menu")
    pilot.draw(3)
    pilot.click("export.copy command")
    pilot.draw(2)
    arguments = shlex.split(clipboard[-1])
    assert arguments[:2] == ["clipgstream", "export"]
    assert arguments[3:6] == ["--format", "ply", "--out"]
    pilot.session.dispatch(CloseQuestion())
