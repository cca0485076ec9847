"""In a small window, what the first hour needs is in sight, or one scroll of its panel away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from imgui_bundle import imgui

from app.session.editing.selection_status import SelectionStatus
from app.session.projects.window_memory import WindowMemory
from engine.editing.actions import Delete
from engine.editing.gaussian_rows import RowSet
from engine.editing.reach import ClipAnchors
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.panels.state import EDIT, EXPORTS, TRAINING
from ui.viewport.editing.select_tool import TOOLS

pytestmark = [pytest.mark.gl, pytest.mark.slow]
AT_ONCE = {
    TRAINING: ("menu.File", "menu.Edit", "menu.Train", "training.next", "timeline.play", "viewport.camera"),
    EDIT: ("edits.undo", "edits.redo", "edits.make delete", "selection.what moves", *(f"strip.{t}" for t in TOOLS)),
    EXPORTS: ("exports.ask",),
}
ONE_SCROLL = ("edits.make recolor", "edits.make smooth", "edits.make moving")


@pytest.fixture(params=[(900, 600, 1.0), (1600, 1000, 1.5)], ids=["900x600", "1600x1000 at 150 %"])
def small(open_pilot: Callable[..., Pilot], request: pytest.FixtureRequest, tmp_path: Path) -> Pilot:
    """A small window, or a larger one with everything drawn larger; something is selected."""
    width, height, scale = request.param
    session = FakeSession()
    session.selection = SelectionStatus("1,240 Gaussians, 3 clips", 1240, 900, can_select=True)
    pilot = open_pilot(session, size=(width, height), memory=WindowMemory(tmp_path / "window.json", ui_scale=scale))
    pilot.rest()
    return pilot


def seen(pilot: Pilot, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Names of items of which nothing is cut off by the part of the window they stand in, nor by the window."""
    found: set[str] = set()
    ui, size = pilot.studio.frame.ui, imgui.get_main_viewport().size
    mark = type(ui).mark

    def record(self, name: str) -> None:
        mark(self, name)
        rect, clip = self.rects[name], imgui.internal.get_current_window().clip_rect
        low, high = (max(clip.min.x, 0.0), max(clip.min.y, 0.0)), (min(clip.max.x, size.x), min(clip.max.y, size.y))
        if low[0] - 1 <= rect.x0 and rect.x1 <= high[0] + 1 and low[1] - 1 <= rect.y0 and rect.y1 <= high[1] + 1:
            found.add(name)

    with monkeypatch.context() as patch:
        patch.setattr(type(ui), "mark", record)
        pilot.draw()
    return found


def test_what_the_first_hour_needs_is_in_sight(small: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    ui = small.studio.frame.ui
    for title, names in AT_ONCE.items():
        ui.wanted_panel = title
        small.draw(6)
        assert set(names) - seen(small, monkeypatch) == set(), title
    ui.open_drawer.clear()
    small.draw(4)
    small.move(*small.rects["edits.make delete"].center)
    small.wheel(-2)
    small.rest()
    assert set(ONE_SCROLL) - seen(small, monkeypatch) == set()
    small.wheel(5)
    small.rest()
    small.click("edits.make delete")
    assert isinstance(small.session.edits.edits[0].action, Delete)


def test_a_remark_on_the_selection_does_not_push_the_buttons_away(
    small: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips = (ClipAnchors(0, 0, 10, "a"), ClipAnchors(1, 10, 20, "b", "a"))
    small.session.edits = replace(small.session.edits, clips=clips)
    small.session.selection = replace(small.session.selection, counts=((RowSet("b", 1, "residual"), 3),))
    small.session.timeline.seek(12)
    small.studio.frame.ui.wanted_panel = EDIT
    small.draw(6)
    assert {"edits.note", "edits.make delete"} <= seen(small, monkeypatch)


def test_parts_of_the_toolbar_without_room_are_in_its_menu(small: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    names = {"viewport.camera", "viewport.mode", "viewport.compare", "viewport.overlays", "viewport.look"}
    could_hide = {"viewport.heat", "viewport.mark", "viewport.views4"}
    found = seen(small, monkeypatch)
    assert names - found == set()
    if could_hide - found:
        small.click("viewport.more")
        small.draw(3)
        assert could_hide - found - seen(small, monkeypatch) == set()
