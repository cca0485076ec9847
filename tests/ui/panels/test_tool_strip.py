"""The strip of tools at the left edge of the picture: by pointer, in a low picture, and with several views."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from app.session.editing.edit_commands import AddEdit
from app.session.editing.selection_status import SelectionStatus
from app.session.projects.preferences import PreferencesFile
from app.session.showing.look_commands import ShowViews
from engine.editing.actions import Transform
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.panels.actions.editing.selecting import ACTIONS
from ui.panels.picture import tool_strip
from ui.panels.state import EXPORTS
from ui.viewport.editing.select_tool import TOOLS

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def selecting() -> FakeSession:
    session = FakeSession()
    session.selection = SelectionStatus("1,240 Gaussians, 3 clips", 1240, 900, can_select=True)
    return session


def test_a_press_takes_a_tool_and_another_one_puts_it_away(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(selecting())
    ui = pilot.studio.frame.ui
    for kind in TOOLS:
        pilot.click(f"strip.{kind}")
        assert ui.selecting.kind == kind
    pilot.click(f"strip.{TOOLS[-1]}")
    assert ui.selecting.kind is None


def test_it_lies_beside_the_picture_in_the_order_of_the_tools(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(selecting())
    rects = pilot.rects
    names = [f"strip.{name}" for name in (*TOOLS, "move")]
    assert sorted(names, key=lambda name: rects[name].y0) == names
    canvas = rects["viewport.canvas"]
    assert all(rects[name].x1 < canvas.x0 for name in names)
    assert all(canvas.y0 <= rects[name].y0 and rects[name].y1 <= canvas.y1 for name in names)
    assert canvas.x0 - rects["viewport.camera"].x0 < 40, "it is slim"


def test_the_tool_in_use_is_seen_without_its_colour(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(selecting())
    rect = pilot.rects["strip.lasso"]
    beside = slice(int(rect.y0) + 3, int(rect.y1) - 3), int(rect.x0) - 3
    assert pilot.picture()[beside].max() < 80
    pilot.click("strip.lasso")
    assert pilot.picture()[beside].min() > 180


def test_move_needs_a_selection_and_leaves_the_movement(open_pilot: Callable[..., Pilot]) -> None:
    session = selecting()
    pilot = open_pilot(session)
    ui = pilot.studio.frame.ui
    there, session.selection = session.selection, SelectionStatus(can_select=True)
    pilot.draw(2)
    pilot.click("strip.move")
    assert pilot.sent(AddEdit) == []
    session.selection = there
    pilot.draw(2)
    pilot.click("strip.move")
    (command,) = pilot.sent(AddEdit)
    assert isinstance(command.action, Transform)
    pilot.draw(2)
    assert ui.editing.chosen is not None
    pilot.click("strip.move")
    assert ui.editing.chosen is None
    assert len(pilot.sent(AddEdit)) == 1


def test_what_has_no_room_is_in_a_menu(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(selecting(), size=(900, 600))
    ui = pilot.studio.frame.ui
    assert "strip.more" not in pilot.rects
    ui.wanted_panel = EXPORTS
    pilot.draw(6)
    assert "strip.flood" not in pilot.rects
    canvas = pilot.rects["viewport.canvas"]
    assert pilot.rects["strip.more"].y1 <= canvas.y1
    pilot.click("strip.more")
    pilot.draw(3)
    pilot.click("strip.flood")
    assert ui.selecting.kind == "flood"


def test_with_several_views_there_is_one_and_alone_the_picture_has_none(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(selecting())
    pilot.session.dispatch(ShowViews(4))
    pilot.draw(4)
    rects = pilot.rects
    assert rects["strip.box"].x1 < rects["viewport.view0"].x0
    assert rects["viewport.view0"].x0 == rects["viewport.view2"].x0
    pilot.click("strip.box")
    assert pilot.studio.frame.ui.selecting.kind == "box"
    pilot.session.dispatch(ShowViews(1))
    pilot.studio.frame.ui.is_picture_only = True
    pilot.draw(4)
    assert "strip.box" not in pilot.rects


def test_a_key_of_the_users_own_stands_in_the_tooltip(
    open_pilot: Callable[..., Pilot], tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[str] = []
    monkeypatch.setattr(tool_strip.imgui, "set_tooltip", words.append)
    pilot = open_pilot(selecting(), preferences=PreferencesFile(tmp_path / "preferences.json"))
    pilot.move(*pilot.rects["strip.lasso"].center)
    pilot.draw(60)
    assert words[-1].startswith("Select: lasso (Shift+R)\n")
    lasso = next(action for action in ACTIONS if action.id == "select.lasso")
    pilot.studio.frame.ui.keys.assign(lasso, "Ctrl+L", ACTIONS)
    pilot.move(pilot.x + 1, pilot.y)
    pilot.draw(60)
    assert words[-1].startswith("Select: lasso (Ctrl+L)\n")


def test_where_nothing_can_be_selected_it_says_why(
    open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[str] = []
    monkeypatch.setattr(tool_strip.imgui, "set_tooltip", words.append)
    pilot = open_pilot()
    pilot.session.selection = SelectionStatus()
    pilot.draw(2)
    pilot.click("strip.box")
    assert pilot.studio.frame.ui.selecting.kind is None
    pilot.draw(60)
    assert words[-1].endswith("No Gaussians to select in this frame.")
