"""The section of copies, on the made-up session."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pyglet.window import key

from app.session.duplicating.copy_commands import ChangeCopy, DuplicateObject, MakeCrowd, RemoveCopies, SwitchCopies
from app.session.editing.edits import edits_status
from engine.editing.copies.object_copy import OnObject
from engine.editing.edit import PickedRows
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from tests.ui.pilot import CTRL, SHIFT, Pilot

pytestmark = [pytest.mark.gl, pytest.mark.slow]
SETS = (PickedRows(0, "own", "moving", pack_rows(np.arange(3))),)
OBJECTS = (SceneObject(1, "one", clips=(ObjectInClip(4, 14, SETS),)), SceneObject(2, "two"))


@pytest.fixture
def panel(open_pilot) -> Pilot:
    """With the section open."""
    pilot = open_pilot(size=(1280, 1900))
    session = pilot.session
    session.content = replace(session.content, objects=OBJECTS)
    session.edits = edits_status(session.content)
    pilot.studio.frame.ui.show_edit("copies")
    pilot.draw(7)
    return pilot


def test_a_copy_is_made_chosen_changed_switched_and_removed(panel: Pilot) -> None:
    panel.click("copies.duplicate")
    panel.draw(3)
    (copy,) = panel.session.edits.copies
    assert (copy.object_id, copy.name) == (1, "one copy 1")
    assert panel.studio.frame.ui.copies.chosen == 1
    panel.click("copies.in place")
    assert panel.session.edits.copies[0].is_in_place
    start = panel.rects["edits.copy shift_frames"].center
    panel.drag(start, (start[0] + 40.0, start[1]))
    panel.draw(2)
    assert panel.session.edits.copies[0].shift_frames > 0.0
    gestures = {command.gesture for command in panel.sent(ChangeCopy)[1:]}
    assert len(gestures) == 1, "a drag is one step"
    panel.click("copies.carrier")
    panel.draw(2)
    panel.click(f"copies.carrier {1 + len(panel.session.paths.paths)}")  # after nothing and the paths
    panel.draw(2)
    assert panel.session.edits.copies[0].carried_by == OnObject(2)
    panel.click("copies.on 1")
    assert panel.sent(SwitchCopies) == [SwitchCopies((1,), is_on=False)]
    panel.click("copies.remove 1")
    assert panel.sent(RemoveCopies) == [RemoveCopies((1,))]
    assert panel.session.edits.copies == ()


def test_a_crowd_is_one_command_and_a_group_goes_at_once(panel: Pilot) -> None:
    panel.click("copies.make crowd")
    panel.draw(3)
    (command,) = panel.sent(MakeCrowd)
    assert (command.n_across, command.n_along, command.shift_frames) == (3, 3, 4.0)
    assert len(panel.session.edits.copies) == 8
    panel.click("copies.on group 1")
    assert not any(copy.is_on for copy in panel.session.edits.copies)
    panel.click("copies.remove group 1")
    assert panel.session.edits.copies == ()


def test_an_object_gets_a_speed_of_its_own_and_keys_duplicate(panel: Pilot) -> None:
    panel.click("copies.speed")
    (copy,) = panel.session.edits.copies
    assert (copy.speed, copy.anchor_frame, copy.is_in_place) == (2.0, 4.0, True)
    panel.studio.frame.ui.copies.object_id = 2
    panel.key(key.D, modifiers=(CTRL, SHIFT))
    assert panel.sent(DuplicateObject)[-1].copy.object_id == 2


def test_without_an_object_the_section_says_what_to_do(open_pilot) -> None:
    pilot = open_pilot(size=(1280, 1900))
    pilot.studio.frame.ui.show_edit("copies")
    pilot.draw(7)
    assert "copies.duplicate" not in pilot.rects
    pilot.key(key.D, modifiers=(CTRL, SHIFT))
    assert pilot.sent(DuplicateObject) == []
