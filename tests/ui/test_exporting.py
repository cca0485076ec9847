"""An export from the dialog to the file: a real session, window and process, by keys and pointer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pyglet.window import key

from app.session.projects.project_commands import OpenProject
from tests.app.residuals.conftest import make_project
from tests.ui.pilot import CTRL, Pilot
from tests.ui.real_session import draw_until, make_session, poll

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def test_from_the_dialog_to_the_file(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    project = make_project(tmp_path)
    session = make_session(tmp_path / "session")
    pilot = open_pilot(session)
    session.dispatch(OpenProject(project))
    draw_until(pilot, lambda: session.capture is not None, "the project")
    pilot.draw(4)
    pilot.key(key.E, modifiers=(CTRL,))
    pilot.draw(4)
    pilot.click("export.kind.metrics")
    out = tmp_path / "out" / "100 %s##figures.csv"
    pilot.click("export.out")
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(str(out))
    pilot.key(key.ENTER)
    draw_until(pilot, lambda: "export.plan" in pilot.rects, "the plan")
    assert session.exporting.statuses == ()
    pilot.key(key.ENTER)
    assert [status.path for status in session.exporting.statuses] == [out]

    pilot.draw(2)
    poll(session, lambda: not session.exporting.is_busy)
    status = session.exporting.statuses[0]
    assert (status.state, status.message) == ("done", "")
    assert len(out.read_text().splitlines()) == 1 + 6 * 4
    pilot.draw(4)
    assert "exports.show1" in pilot.rects
    pilot.click("exports.remove1")
    assert session.exporting.statuses == ()
    assert out.exists()
    assert not [notice for notice in session.notices if notice.kind == "error"]
