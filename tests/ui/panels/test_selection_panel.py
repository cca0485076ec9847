"""The selection panel by pointer and keys, on the made-up session: which commands come of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pyglet.window import key

from app.playback.modes.arrays import AnchorArrays
from app.session.editing.selection_commands import (
    ClearSelection,
    GrowSelection,
    How,
    InvertSelection,
    Reselect,
    SelectAll,
    SelectByAttribute,
    SelectionCommand,
    SelectVolume,
    ShrinkSelection,
)
from app.session.editing.selection_status import SelectionStatus
from engine.editing.edit import Box, Sphere
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.state import EDIT
from ui.viewport.editing.select_tool import TOOLS, SelectTool

pytestmark = pytest.mark.gl


@pytest.fixture
def panel(open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch) -> Pilot:
    """A tall window, so that nothing of the panel has to be scrolled to."""
    session = FakeSession()
    session.selection = SelectionStatus(
        "1,240 Gaussians, 96 anchors, 3 clips", 1240, 900, has_before=True, can_select=True
    )
    anchors = AnchorArrays(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), key="spaced", spacing=0.2)
    monkeypatch.setattr(session, "shown_anchors", lambda: anchors)
    pilot = open_pilot(session, size=(1280, 1500))
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.draw(4)
    for header in ("volume", "attribute"):
        pilot.click(f"edits.{header}")
        pilot.draw(2)
    return pilot


def about(value: float, *, abs: float | None = None) -> Any:
    """Equal to numbers near it, in the place of one."""
    return pytest.approx(value, abs=abs)


def tool(pilot: Pilot) -> SelectTool:
    return pilot.studio.frame.ui.selecting


@pytest.mark.slow
def test_every_button_sends_its_command(panel: Pilot) -> None:
    for name, command in (
        ("all", SelectAll()),
        ("none", ClearSelection()),
        ("invert", InvertSelection()),
        ("before", Reselect()),
        ("grow", GrowSelection(about(0.3))),
        ("shrink", ShrinkSelection(about(0.3))),
    ):
        panel.click(f"selection.{name}")
        assert panel.session.commands[-1] == command


@pytest.mark.slow
def test_the_same_by_keys(panel: Pilot) -> None:
    for symbol, modifiers, command in (
        (key.A, (CTRL,), SelectAll()),
        (key.A, (CTRL, SHIFT), ClearSelection()),
        (key.I, (CTRL,), InvertSelection()),
        (key.Z, (key.LALT,), Reselect()),
        (key.BRACKETRIGHT, (CTRL,), GrowSelection(about(0.3))),
        (key.BRACKETLEFT, (CTRL,), ShrinkSelection(about(0.3))),
    ):
        panel.key(symbol, modifiers=modifiers)
        assert panel.session.commands[-1] == command


@pytest.mark.slow
def test_tools_modes_and_options(panel: Pilot) -> None:
    for kind in TOOLS:
        panel.click(f"selection.{kind}")
        assert tool(panel).kind == kind
    panel.click("selection.flood")
    assert tool(panel).kind is None
    for mode in ("subtract", "intersect", "add", "replace"):
        panel.click(f"selection.{mode}")
        assert tool(panel).mode == mode
    for name in ("is_visible_only", "is_by_extent", "is_whole_anchors"):
        panel.click(f"selection.{name}")
        assert getattr(tool(panel), name)


@pytest.mark.slow
def test_what_moves_is_selected_by_a_button(panel: Pilot) -> None:
    panel.click("selection.subtract")
    panel.click("selection.what moves")
    assert panel.sent(SelectByAttribute) == [SelectByAttribute("motion", 1.0, 1.0, How("subtract"))]


@pytest.mark.slow
def test_a_range_by_its_handles_and_by_numbers(panel: Pilot) -> None:
    bars = panel.rects["selection.histogram"]
    panel.drag((bars.x0 + 2, bars.center[1]), (bars.x0 + 0.25 * bars.width, bars.center[1]))
    panel.drag((bars.x1 - 2, bars.center[1]), (bars.x0 + 0.75 * bars.width, bars.center[1]))
    panel.click("selection.add")
    panel.click("selection.by_range")
    (command,) = panel.sent(SelectByAttribute)
    assert command == SelectByAttribute("opacity", about(0.25, abs=0.02), about(0.75, abs=0.02), How("add"))
    panel.click("selection.low")
    panel.key(key.A, modifiers=(CTRL,))
    panel.type("0.5")
    panel.key(key.ENTER)
    panel.click("selection.by_range")
    assert panel.sent(SelectByAttribute)[-1].low == pytest.approx(0.5)
    panel.click("selection.low")  # beyond the upper end: held there
    panel.key(key.A, modifiers=(CTRL,))
    panel.type("9")
    panel.key(key.ENTER)
    panel.click("selection.by_range")
    last = panel.sent(SelectByAttribute)[-1]
    assert last.low == last.high == pytest.approx(0.75, abs=0.02)


def test_the_whole_range_holds_its_ends_exactly(panel: Pilot) -> None:
    panel.click("selection.by_range")
    assert panel.sent(SelectByAttribute) == [SelectByAttribute("opacity", 0.0, 1.0)]


@pytest.mark.slow
def test_attributes_with_few_values_are_chosen_by_name(panel: Pilot) -> None:
    tool(panel).attribute = "birth"
    panel.draw(2)
    panel.click("selection.choice.birth.2")
    assert panel.sent(SelectByAttribute) == [SelectByAttribute("birth", 2, 2)]
    tool(panel).attribute = "error"  # not known: words instead of a histogram
    panel.draw(2)
    assert "selection.histogram" not in panel.rects


@pytest.mark.slow
def test_a_box_and_a_sphere_by_numbers(panel: Pilot) -> None:
    panel.click("selection.new_sphere")
    panel.click("selection.radius")
    panel.key(key.A, modifiers=(CTRL,))
    panel.type("0.75")
    panel.key(key.ENTER)
    panel.click("selection.by_volume")
    (command,) = panel.sent(SelectVolume)
    assert isinstance(command.volume, Sphere)
    assert command.volume.radius == pytest.approx(0.75)
    assert command.volume.center == pytest.approx(tuple(panel.session.view.pivot))
    panel.click("selection.radius")
    panel.key(key.A, modifiers=(CTRL,))
    panel.type("-4")  # a radius below nothing is held
    panel.key(key.ENTER)
    held = tool(panel).volume
    assert isinstance(held, Sphere)
    assert held.radius > 0.0
    panel.click("selection.new_box")
    panel.click("selection.by_volume")
    assert isinstance(panel.sent(SelectVolume)[-1].volume, Box)


@pytest.mark.slow
def test_what_cannot_be_done_is_not_offered(panel: Pilot) -> None:
    panel.session.selection = SelectionStatus()
    panel.draw(2)
    for name in ("all", "none", "grow", "by_range"):
        panel.click(f"selection.{name}")
    panel.key(key.A, modifiers=(CTRL,))
    panel.key(key.R)
    assert not any(isinstance(command, SelectionCommand) for command in panel.session.commands)
    assert tool(panel).kind is None
