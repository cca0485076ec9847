"""Keys of volumes by buttons, keys, handles and on the timeline, on the made-up session."""

from __future__ import annotations

import pytest
from msgspec import structs
from pyglet.window import key

from app.session.editing.edit_commands import AddEdit, ChangeEdit
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Box, KeyedVolume
from engine.editing.volumes.keyed_volume import volume_at
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.state import EDIT

pytestmark = [pytest.mark.gl, pytest.mark.slow]
BOX = Box((0.0, 0.0, 0.0), (0.5, 0.4, 0.3))
ALT = key.LALT


@pytest.fixture
def panel(open_pilot) -> Pilot:
    """With the panel in front, and an edit of a box chosen."""
    pilot = open_pilot(size=(1280, 1100))
    pilot.session.dispatch(AddEdit(Delete(), BOX))
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.studio.frame.ui.editing.choose(1)
    pilot.draw(4)
    return pilot


def show(pilot: Pilot, frame_index: int) -> None:
    pilot.session.timeline.seek(frame_index)
    pilot.draw(2)


def keyed(pilot: Pilot) -> KeyedVolume:
    target = pilot.session.edits.edits[0].target
    assert isinstance(target, KeyedVolume)
    return target


def drag_face(pilot: Pilot) -> None:
    x, y = pilot.rects["handle.face +x"].center
    pilot.drag((x, y), (x + 40, y + 10))
    pilot.draw(2)


def test_once_keyed_each_drag_of_a_handle_sets_the_key_of_the_shown_frame_in_one_step(panel: Pilot) -> None:
    assert "timeline.volume_key0" not in panel.rects
    show(panel, 5)
    panel.key(key.K, modifiers=(CTRL, SHIFT))
    assert [one.frame for one in keyed(panel).keys] == [5.0]
    assert keyed(panel).keys[0].volume == BOX
    show(panel, 15)
    n_before = len(panel.sent(ChangeEdit))
    drag_face(panel)
    assert [one.frame for one in keyed(panel).keys] == [5.0, 15.0]
    assert keyed(panel).keys[0].volume == BOX, "the other key stays"
    assert keyed(panel).keys[1].volume != BOX
    sent = panel.sent(ChangeEdit)[n_before:]
    assert len(sent) > 1
    assert len({(one.gesture, one.verb) for one in sent}) == 1, "a drag is one step back"
    assert sent[0].gesture > 0
    show(panel, 10)
    assert {"timeline.volume_key0", "timeline.volume_key1", "handle.face +x"} <= {*panel.rects}
    middle = volume_at(keyed(panel), 10.0)
    panel.click("volume.key")
    assert keyed(panel).keys[1].volume == middle, "a key is as the volume is there"
    panel.click("volume.remove_key")
    assert [one.frame for one in keyed(panel).keys] == [5.0, 15.0]


def test_keys_are_gone_to_dragged_in_time_and_removed(panel: Pilot) -> None:
    for frame_index in (5, 15, 25):
        show(panel, frame_index)
        panel.key(key.K, modifiers=(CTRL, SHIFT))
    timeline = panel.session.timeline
    show(panel, 12)
    for symbol, expected in ((key.COMMA, 5), (key.PERIOD, 15), (key.PERIOD, 25), (key.PERIOD, 25)):
        panel.key(symbol, modifiers=(ALT, SHIFT))
        assert timeline.frame_index == expected
    panel.click("volume.previous_key")
    assert timeline.frame_index == 15
    start, first = (panel.rects[f"timeline.volume_key{index}"].center for index in (1, 0))
    panel.drag(start, ((start[0] + first[0]) / 2, start[1]))
    frames = [one.frame for one in keyed(panel).keys]
    assert frames[::2] == [5.0, 25.0]
    assert frames[1] in (9.0, 10.0, 11.0)
    assert timeline.frame_index == frames[1], "the playhead goes along"
    assert len({one.gesture for one in panel.sent(ChangeEdit)[3:]}) == 1
    panel.drag(panel.rects["timeline.volume_key1"].center, (first[0] - 60, first[1]))
    assert [one.frame for one in keyed(panel).keys] == [5.0, 6.0, 25.0], "held by its neighbour"
    panel.tap(*panel.rects["timeline.volume_key2"].center)
    panel.draw(2)
    assert timeline.frame_index == 25
    panel.key(key.K, modifiers=(ALT, SHIFT))
    assert [one.frame for one in keyed(panel).keys] == [5.0, 6.0]
    panel.click("volume.unkey")
    assert panel.session.edits.edits[0].target == BOX
    panel.draw(2)
    assert "timeline.volume_key0" not in panel.rects


def test_numbers_change_the_key_of_the_shown_frame(panel: Pilot) -> None:
    panel.session.dispatch(ChangeEdit(structs.replace(panel.session.edits.edits[0], action=Expose(1.0))))
    for frame_index in (0, 20):
        show(panel, frame_index)
        panel.key(key.K, modifiers=(CTRL, SHIFT))
    show(panel, 10)
    x, y = panel.rects["edits.center"].center
    panel.drag((x, y), (x + 30, y))
    assert [one.frame for one in keyed(panel).keys] == [0.0, 10.0, 20.0]


@pytest.mark.usefixtures("lasting_notices")
def test_an_edit_without_a_volume_says_so(panel: Pilot) -> None:
    panel.session.dispatch(AddEdit(Expose(1.0)))
    panel.studio.frame.ui.editing.choose(2)
    panel.draw(2)
    panel.key(key.K, modifiers=(CTRL, SHIFT))
    panel.key(key.COMMA, modifiers=(ALT, SHIFT))
    assert [notice.title for notice in panel.session.notices] == [
        "The chosen edit does not act on a volume.",
        "The volume of the chosen edit has no keys.",
    ]
