"""Layouts by name, the picture alone, and going from panel to panel by keyboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pyglet.window import key

from app.session.projects.preferences import PreferencesFile
from app.session.projects.project_commands import OpenCapture, OpenProject
from app.session.showing.look_commands import SetFrame, TogglePlay
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.picture.tool_strip import STRIP_WIDTH
from ui.panels.state import EDIT, PANELS, TIMELINE

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def run(pilot: Pilot, typed: str) -> None:
    """By the palette."""
    pilot.key(key.K, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.type(typed)
    pilot.draw(2)
    pilot.key(key.ENTER)
    pilot.rest()
    pilot.draw(8)


def test_layouts_of_the_program_are_shown(pilot: Pilot) -> None:
    usual = pilot.rects["timeline.track"]
    run(pilot, "layout tall timeline")
    assert pilot.rects["timeline.track"].height > usual.height + 40
    run(pilot, "layout default")
    assert pilot.rects["timeline.track"].height == pytest.approx(usual.height, abs=2)


def test_a_layout_is_kept_by_name_shown_again_and_removed(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    pilot = open_pilot(preferences=file)
    canvas = pilot.rects["viewport.canvas"]
    border = canvas.x0 - STRIP_WIDTH - 1
    pilot.drag((border, canvas.center[1]), (border + 91, canvas.center[1]), steps=5)
    pilot.rest()
    wide = pilot.rects["viewport.canvas"].x0
    assert wide > canvas.x0 + 50
    run(pilot, "save the layout")
    pilot.type("100 % ##mine")
    pilot.key(key.ENTER)
    pilot.rest()
    assert list(file.values.layouts) == ["100 % ##mine"]
    run(pilot, "layout default")
    assert pilot.rects["viewport.canvas"].x0 == pytest.approx(canvas.x0, abs=2)
    pilot.studio.close()

    again = open_pilot(preferences=PreferencesFile(file.path))
    run(again, "##mine")
    assert again.rects["viewport.canvas"].x0 == pytest.approx(wide, abs=3)
    run(again, "remove ##mine")
    assert again.studio.frame.ui.preferences.layouts == {}


def test_a_layout_of_other_panels_changes_nothing(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.values.layouts["old"] = "[Window][Viewport]\nPos=9,9\n"
    pilot = open_pilot(preferences=file)
    before = pilot.rects["viewport.canvas"]
    run(pilot, "layout: old")
    assert pilot.rects["viewport.canvas"] == before


def test_names_of_the_program_s_layouts_are_taken(pilot: Pilot) -> None:
    run(pilot, "save the layout")
    pilot.type("Standard")
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert "layout.name" in pilot.rects, "it asks for another one"
    pilot.key(key.ESCAPE)
    pilot.rest()
    assert pilot.studio.frame.ui.preferences.layouts == {}


def test_the_picture_alone_and_back(pilot: Pilot) -> None:
    before = dict(pilot.rects)
    pilot.key(key.F, modifiers=(CTRL, SHIFT))
    pilot.rest()
    pilot.draw(4)
    assert "timeline.track" not in pilot.rects
    assert "training.next" not in pilot.rects
    assert pilot.rects["viewport.canvas"].width > 1250
    pilot.key(key.SPACE)
    assert len(pilot.sent(TogglePlay)) == 1, "keys go on"
    pilot.key(key.F, modifiers=(CTRL, SHIFT))
    pilot.rest()
    pilot.draw(4)
    for name in ("timeline.track", "viewport.canvas", "training.next"):
        assert vars(pilot.rects[name]) == pytest.approx(vars(before[name]), abs=2), name


def test_f6_goes_from_panel_to_panel_and_escape_gives_the_keys_back(pilot: Pilot) -> None:
    ui = pilot.studio.frame.ui
    ui.wanted_panel = EDIT
    pilot.draw(3)
    seen = set(pilot.studio.frame._visible_panels)
    in_order = [title for title in PANELS if title in seen]
    assert EDIT in in_order
    assert len(in_order) < len(PANELS), "some lie behind others"
    visited = []
    for _ in (*in_order, None):
        pilot.key(key.F6)
        pilot.draw(2)
        visited.append(ui.keyed_panel)
        assert pilot.studio.frame._visible_panels == seen, "tabs stay as they are"
    assert visited == [*in_order, None]
    pilot.key(key.F6)
    pilot.draw(3)
    frame_index = pilot.session.timeline.frame_index
    for symbol in (key.DOWN, key.DOWN, key.SPACE):
        pilot.key(symbol)
    pilot.draw(2)
    assert pilot.session.view.look_through is not None, "arrow keys and Space chose a camera of the list"
    assert pilot.session.timeline.frame_index == frame_index
    assert pilot.sent(TogglePlay) == []
    pilot.key(key.ESCAPE)
    pilot.draw(2)
    assert ui.keyed_panel is None
    pilot.key(key.RIGHT)
    assert pilot.sent(SetFrame) == [SetFrame(1)]


def test_a_click_gives_the_keys_back(pilot: Pilot) -> None:
    pilot.key(key.F6, modifiers=(SHIFT,))
    pilot.draw(2)
    assert pilot.studio.frame.ui.keyed_panel == TIMELINE
    pilot.click("capture.free")
    assert pilot.studio.frame.ui.keyed_panel is None


def test_the_first_screen_is_driven_by_keyboard(open_pilot: Callable[..., Pilot]) -> None:

    pilot = open_pilot(FakeSession(has_capture=False))
    for _ in range(4):
        pilot.key(key.DOWN)
        pilot.draw(2)
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert [command for command in pilot.session.commands if isinstance(command, OpenCapture | OpenProject)]
