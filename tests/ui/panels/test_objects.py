"""Objects in the window: the section, the lane of the timeline, the outlines and the keys, on the made-up session."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from msgspec import structs
from pyglet.window import key

from app.session.commands import CancelJob
from app.session.edit_status import EditsStatus
from app.session.editing.edit_commands import AddEdit
from app.session.editing.edits import edits_status
from app.session.editing.selection_status import SelectionStatus
from app.session.objects.object_commands import (
    CorrectObject,
    FindObject,
    MakeObject,
    RecolourObject,
    RemoveObject,
    RenameObject,
    SelectObject,
    SetObjectSpan,
    SetObjectTrained,
)
from app.session.showing.look_commands import SetFrame
from app.status import JobStatus
from engine.editing.actions import Delete, Hide
from engine.editing.edit import ObjectTarget, PickedRows
from engine.editing.picks import pack_rows
from engine.editing.reach import ClipAnchors
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from tests.ui.pilot import CTRL, SHIFT, Pilot

ALT = key.LALT
pytestmark = [pytest.mark.gl, pytest.mark.slow]
ROWS = (PickedRows(0, "a", "moving", pack_rows(np.arange(4))),)
CLIPS = tuple(ClipAnchors(i, 10 * i, 10 * i + 10, name) for i, name in enumerate("abc"))
FOUND = (
    ObjectInClip(0, 10, ROWS, ((0, 10),), 0.95, "", "a"),
    ObjectInClip(10, 20, ROWS, ((12, 20),), 0.4, "touching", "b"),
    ObjectInClip(20, 30, ROWS, ((20, 25),), 0.9, "", "before"),
)
SELECTED = SelectionStatus("1,240 Gaussians", 1240, 900, can_select=True)


def objects(n: int = 1) -> tuple[SceneObject, ...]:
    names = ("left player", "ball", "right player", "referee", "coach", "bird")
    return tuple(
        SceneObject(i + 1, names[i], (0.2 * i, 0.6, 1.0 - 0.1 * i), (ObjectSeed(4, ROWS),), FOUND) for i in range(n)
    )


def put(pilot: Pilot, *found: SceneObject) -> None:
    session = pilot.session
    session.content = dataclasses.replace(session.content, objects=found)
    session.edits = dataclasses.replace(edits_status(session.content), clips=CLIPS)
    pilot.draw(3)


@pytest.fixture
def panel(open_pilot) -> Pilot:
    """With the panel in front and an object."""
    pilot = open_pilot(size=(1280, 1100))
    pilot.studio.frame.ui.show_edit("objects")
    pilot.draw(4)
    put(pilot, *objects())
    return pilot


def choose(pilot: Pilot, object_id: int = 1) -> None:
    pilot.click(f"objects.row{object_id}")
    pilot.draw(2)
    assert pilot.studio.frame.ui.objects.chosen == object_id


def test_a_selection_becomes_an_object_which_is_chosen(panel: Pilot) -> None:
    panel.click("objects.new")
    assert panel.sent(MakeObject) == [], "nothing is selected"
    panel.session.selection = SELECTED
    panel.draw(2)
    panel.click("objects.new")
    assert panel.sent(MakeObject) == [MakeObject()]
    panel.draw(2)
    assert panel.studio.frame.ui.objects.chosen == 2
    panel.key(key.G, modifiers=(CTRL, SHIFT))
    assert panel.sent(MakeObject) == [MakeObject()] * 2
    assert panel.studio.frame.ui.objects.chosen == 3


def test_the_chosen_object_is_corrected_looked_for_and_removed(panel: Pilot) -> None:
    choose(panel)
    panel.click("objects.add")
    assert panel.sent(CorrectObject) == [], "nothing is selected"
    panel.session.selection = SELECTED
    panel.draw(2)
    panel.click("objects.add")
    panel.click("objects.subtract")
    panel.key(key.I, modifiers=(ALT,))
    panel.key(key.I, modifiers=(ALT, SHIFT))
    assert panel.sent(CorrectObject) == [CorrectObject(1, adds=adds) for adds in (True, False, True, False)]
    panel.click("objects.find")
    panel.click("objects.select")
    panel.key(key.O, modifiers=(ALT,))
    assert panel.sent(FindObject) == [FindObject(1)]
    assert panel.sent(SelectObject) == [SelectObject(1)] * 2
    panel.click("objects.trained")
    assert panel.sent(SetObjectTrained) == [SetObjectTrained(1, is_trained=False)]
    panel.click("objects.remove")
    assert panel.sent(RemoveObject) == [RemoveObject(1)]
    panel.draw(2)
    assert panel.studio.frame.ui.objects.chosen is None


def test_a_double_click_or_f2_renames(panel: Pilot) -> None:
    at = panel.rects["objects.row1"].center
    panel.tap(*at)
    panel.tap(*at)
    panel.draw(2)
    panel.type("the ball")
    panel.key(key.RETURN)
    assert panel.sent(RenameObject) == [RenameObject(1, "the ball")]
    panel.draw(3)
    assert "objects.name" not in panel.rects or panel.studio.frame.ui.objects.renamed is None
    panel.key(key.F2)
    panel.draw(2)
    assert panel.studio.frame.ui.objects.renamed == 1
    panel.type("x")
    panel.key(key.ESCAPE)
    panel.draw(2)
    assert len(panel.sent(RenameObject)) == 1
    assert panel.studio.frame.ui.objects.renamed is None


def test_its_frames_are_those_from_in_to_out(panel: Pilot) -> None:
    choose(panel)
    panel.click("objects.span")
    assert panel.sent(SetObjectSpan) == [], "it is in all frames, and so are in and out"
    panel.session.timeline.in_frame, panel.session.timeline.out_frame = 5, 14
    panel.draw(2)
    panel.click("objects.span")
    panel.draw(2)
    panel.click("objects.span")
    assert panel.sent(SetObjectSpan) == [SetObjectSpan(1, 5, 15), SetObjectSpan(1, 0, None)]


def test_a_search_can_be_stopped(panel: Pilot) -> None:
    panel.session.jobs = [JobStatus("Finding left player", 0.4, can_cancel=True)]
    choose(panel)
    panel.click("objects.stop")
    assert panel.sent(CancelJob) == [CancelJob("Finding left player")]


def test_new_edits_act_on_the_chosen_object_unless_something_is_selected(panel: Pilot) -> None:
    choose(panel)
    panel.key(key.H)
    assert panel.sent(AddEdit)[-1] == AddEdit(Hide(), ObjectTarget(1))
    panel.click("edits.make delete")
    assert panel.sent(AddEdit)[-1] == AddEdit(Delete(), ObjectTarget(1))
    panel.key(key.H, modifiers=(SHIFT,))
    assert panel.sent(AddEdit)[-1] == AddEdit(Hide(), ObjectTarget(1), is_inverted=True)
    panel.session.selection = SELECTED
    panel.draw(2)
    panel.key(key.H)
    assert panel.sent(AddEdit)[-1] == AddEdit(Hide())


def test_a_read_only_project_offers_nothing_that_changes_it(panel: Pilot) -> None:
    choose(panel)
    session = panel.session
    session.edits = dataclasses.replace(session.edits, can_edit=False, why_not="Open read-only.")
    session.selection = SELECTED
    panel.draw(2)
    for name in ("new", "add", "subtract", "find", "remove", "trained"):
        panel.click(f"objects.{name}")
    assert not panel.sent(MakeObject) + panel.sent(CorrectObject) + panel.sent(FindObject) + panel.sent(RemoveObject)
    assert not panel.sent(SetObjectTrained) + panel.sent(RecolourObject)


# ---------------------------------------------------------------- timeline


def x_of(pilot: Pilot, frame_index: float) -> float:
    track = pilot.rects["timeline.track"]
    return track.x0 + frame_index / 30 * track.width


def test_the_lane_is_there_with_the_first_object(panel: Pilot) -> None:
    assert "timeline.object1" in panel.rects
    panel.rects.clear()
    put(panel)
    assert "timeline.object1" not in panel.rects


def test_a_press_in_the_lane_chooses_the_object_and_goes_there(panel: Pilot) -> None:
    put(panel, *objects(2))
    strip = panel.rects["timeline.object2"]
    panel.tap(x_of(panel, 14.5), strip.center[1])
    panel.draw(2)
    assert panel.studio.frame.ui.objects.chosen == 2
    assert panel.sent(SetFrame)[-1] == SetFrame(14)


def test_more_than_four_are_scrolled_to(panel: Pilot) -> None:
    panel.rects.clear()
    put(panel, *objects(6))
    assert {name for name in panel.rects if name.startswith("timeline.object")} == {
        f"timeline.object{i}" for i in (1, 2, 3, 4)
    }
    panel.move(*panel.rects["timeline.object2"].center)
    panel.rects.clear()
    panel.wheel(-1.0)
    panel.draw(2)
    assert "timeline.object5" in panel.rects
    assert "timeline.object1" not in panel.rects


def test_the_chosen_object_is_outlined_and_all_where_that_is_wanted(panel: Pilot) -> None:
    tool = panel.studio.frame.ui.objects
    put(panel, *objects(3))
    assert tool.outlined(panel.session.edits.objects) == ()
    panel.key(key.O, modifiers=(ALT, SHIFT))
    assert [one.object_id for one in tool.outlined(panel.session.edits.objects)] == [1]
    panel.key(key.O, modifiers=(ALT, SHIFT))
    assert [one.object_id for one in tool.outlined(panel.session.edits.objects)] == [2]
    panel.key(key.O, modifiers=(CTRL, SHIFT))
    assert len(tool.outlined(panel.session.edits.objects)) == 3
    panel.draw(4)


def test_states_in_words(panel: Pilot) -> None:
    from ui.panels.editing.panel.objects import state_text

    session = panel.session
    one = session.edits.objects[0]
    assert state_text(session, one) == (
        "frames 0-9, 12-24, doubtful in frames 10-19, not looked at: frames 20-29"
    ).replace("9, 12-24", "9 and 12-24")
    whole = structs.replace(one, clips=FOUND[:1], is_trained=False)
    session.edits = EditsStatus(clips=CLIPS[:1])
    assert state_text(session, whole) == "frames 0-9, sure, left out of training"
