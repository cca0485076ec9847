"""The panel Edit as a whole: its parts stand in the order of the work; those folded away open when they are used."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pyglet.window import key

from app.session.editing.edit_commands import AddEdit, Undo
from app.session.editing.mark_commands import MarkRegion
from app.session.editing.selection_status import SelectionStatus
from engine.editing.actions import Hide, Recolor
from engine.editing.edit import Box
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot
from ui.panels.actions.table import ACTIONS
from ui.panels.state import EDIT, EDIT_SECTIONS, PANELS, TRAINING, Rect

pytestmark = [pytest.mark.gl, pytest.mark.slow]
BOX = Box((0.0, 0.0, 0.0), (0.5, 0.4, 0.3))


def opened(open_pilot: Callable[..., Pilot], size: tuple[int, int]) -> Pilot:
    """With something selected, and the panel in front."""
    session = FakeSession()
    session.selection = SelectionStatus("1,240 Gaussians, 3 clips", 1240, 900, can_select=True)
    pilot = open_pilot(session, size=size)
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.draw(6)
    return pilot


def parts(pilot: Pilot) -> Rect:
    """Where parts of the panel are seen: below its two lines on the target, and as far down as the picture."""
    canvas = pilot.rects["viewport.canvas"]
    return Rect(canvas.x1, pilot.rects["edits.undo"].y1, 2000.0, canvas.y1)


def is_seen(pilot: Pilot, name: str) -> bool:
    area, rect = parts(pilot), pilot.rects.get(name)
    return rect is not None and area.y0 <= rect.y0 and rect.y1 <= area.y1


def test_three_panels_are_one(open_pilot: Callable[..., Pilot]) -> None:
    assert [title for title in PANELS if title in ("Edit", "Edits", "Selection", "Regions")] == ["Edit"]
    pilot = opened(open_pilot, (1280, 1500))
    rects = pilot.rects
    in_order = ("selection.counts", "selection.box", "edits.scope clip", "edits.make delete", "edits.attribute")
    assert sorted(in_order, key=lambda name: rects[name].y0) == list(in_order)
    pilot.click("edits.make recolor")
    pilot.draw(2)
    rects = pilot.rects
    in_order = ("edits.make recolor", "edits.tint_share", "edits.scope", "edits.row1", "edits.regions", "edits.world")
    assert sorted(in_order, key=lambda name: rects[name].y0) == list(in_order)


@pytest.mark.parametrize("size", [(900, 600), (1600, 1000)])
def test_numbers_of_a_new_edit_are_in_sight_and_nothing_moves_while_they_change(
    open_pilot: Callable[..., Pilot], size: tuple[int, int]
) -> None:
    pilot = opened(open_pilot, size)
    assert is_seen(pilot, "edits.make delete"), "without scrolling"
    if not is_seen(pilot, "edits.make recolor"):
        pilot.move(*pilot.rects["edits.make delete"].center)
        pilot.wheel(-2)
        pilot.rest()
    before = pilot.rects["edits.make recolor"]
    pilot.click("edits.make recolor")
    pilot.rest()
    for name in ("edits.tint", "edits.tint_share", "edits.opacity"):
        assert is_seen(pilot, name), name
    if size == (1600, 1000):
        assert pilot.rects["edits.make recolor"] == before, "there was room"
    field = pilot.rects["edits.tint_share"]
    pilot.drag(field.center, (field.center[0] + 40, field.center[1]))
    pilot.rest()
    action = pilot.session.edits.edits[0].action
    assert isinstance(action, Recolor)
    assert action.tint_share > 0.0
    assert pilot.rects["edits.tint_share"] == field
    pilot.click("edits.undo")
    assert len(pilot.sent(Undo)) == 1, "undo is in sight wherever the panel stands"


def test_a_clicked_row_of_the_stack_stays_under_the_pointer(open_pilot: Callable[..., Pilot]) -> None:
    pilot = opened(open_pilot, (1280, 1000))
    ui = pilot.studio.frame.ui
    for _ in range(3):
        pilot.session.dispatch(AddEdit(Hide(), BOX))
    ui.show_edit("edits")
    pilot.draw(4)
    row = pilot.rects["edits.row1"]
    for chosen in (1, None):
        pilot.click("edits.row1")
        pilot.rest()
        assert ui.editing.chosen == chosen
        assert pilot.rects["edits.row1"].y0 == pytest.approx(row.y0, abs=1)


@pytest.mark.parametrize("name", ["attribute", "volume", "regions", "world"])
def test_the_palette_goes_to_a_part_and_unfolds_it(open_pilot: Callable[..., Pilot], name: str) -> None:
    inside = {"attribute": "selection.attribute", "volume": "selection.new_box", "regions": "regions.begin"}
    pilot = opened(open_pilot, (1280, 800))
    pilot.studio.frame.ui.wanted_panel = TRAINING
    pilot.draw(4)
    pilot.key(key.K, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.type(f"in the panel edit: {EDIT_SECTIONS[name]}")
    pilot.draw(2)
    pilot.key(key.ENTER)
    pilot.rest()
    assert is_seen(pilot, f"edits.{name}")
    assert is_seen(pilot, inside.get(name, "world.up"))


def test_ids_of_actions_that_showed_the_old_panels_are_kept(open_pilot: Callable[..., Pilot]) -> None:
    """A key of the user's own goes on leading there."""
    ids = {action.id for action in ACTIONS}
    assert {"window.panel.regions", "window.panel.selection", "window.panel.edits", "window.panel.edit"} <= ids


def test_headers_unfold_when_their_tool_is_taken(open_pilot: Callable[..., Pilot]) -> None:
    pilot = opened(open_pilot, (1280, 800))
    ui = pilot.studio.frame.ui
    pilot.move(*pilot.rects["viewport.canvas"].center)
    pilot.key(key.M)
    pilot.rest()
    assert is_seen(pilot, "regions.radius")
    pilot.key(key.RETURN)
    assert len(pilot.sent(MarkRegion)) == 1
    pilot.rest()
    ui.show_edit("selection")
    pilot.draw(4)
    delete = pilot.rects["edits.make delete"]
    ui.selecting.kind, ui.selecting.volume = "box", BOX
    pilot.draw(4)
    assert "selection.by_volume" in pilot.rects, "its numbers are further below"
    assert pilot.rects["edits.make delete"] == delete, "and nothing moves"
