"""The take in the window: its lane, its section of the Edit panel, and its keys, on the made-up session."""

from __future__ import annotations

import pytest
from pyglet.window import key

from app.document.changes.timing_changes import ChangeSegment, ChangeSpeed, Freeze, Loop, Order, ResetTime, Split, Trim
from engine.timing.segment import Segment
from tests.ui.pilot import SHIFT, Pilot
from ui.panels.editing.panel.timing import changed_segment
from ui.panels.state import EDIT
from ui.panels.timeline.rows.take_lane import MAX_LEVELS, levels_of

pytestmark = [pytest.mark.gl, pytest.mark.slow]
ALT = key.LALT


@pytest.fixture
def panel(open_pilot) -> Pilot:
    """With the section open, and the take in three segments."""
    pilot = open_pilot(size=(1280, 1300))
    pilot.studio.frame.ui.wanted_panel = EDIT
    for edit in (Split(10), ChangeSpeed((10, 20), 0.5), Freeze(5, 12)):
        pilot.session.dispatch(edit)
    pilot.session.commands.clear()
    pilot.draw(4)
    pilot.click("edits.timing")
    pilot.draw(4)
    return pilot


def segments(pilot: Pilot) -> tuple[Segment, ...]:
    return pilot.session.edits.timing


def test_keys_begin_a_take_and_end_it(pilot: Pilot) -> None:
    assert "timeline.segment0" not in pilot.rects
    pilot.session.timeline.seek(12)
    pilot.key(key.K, modifiers=(SHIFT,))
    pilot.session.timeline.set_range(4, 19)
    pilot.key(key.O, modifiers=(SHIFT,))
    pilot.key(key.J, modifiers=(ALT,))
    pilot.key(key.L, modifiers=(ALT,))
    found = [type(command) for command in pilot.session.commands]
    assert [kind for kind in found if kind in (Split, Trim, Freeze)] == [Split, Trim, Freeze]
    assert pilot.sent(Trim) == [Trim((4, 20))]
    assert pilot.sent(Loop) == [Loop((4, 20), 3)]


def test_a_click_in_the_lane_chooses_a_segment_and_keys_change_it(panel: Pilot) -> None:
    before, frame = segments(panel), panel.session.timeline.frame_index
    panel.click("timeline.segment3")
    assert panel.studio.frame.ui.timeline.segment == 3
    assert panel.session.timeline.frame_index == frame, "the playhead stays"
    assert before[3] == Segment(10, 20, 0.5, 0.5)
    panel.key(key.J, modifiers=(SHIFT,))
    panel.key(key.PERIOD, modifiers=(ALT,))
    panel.key(key.L, modifiers=(ALT,))
    assert segments(panel)[3] == Segment(10, 20, 1.0, 1.0, is_reversed=True, repeats=3)
    assert {command.place for command in panel.sent(ChangeSegment)} == {3}
    panel.key(key.J, modifiers=(ALT, SHIFT))
    assert panel.sent(ResetTime) == [ResetTime()]
    panel.draw(2)
    assert "timeline.segment0" not in panel.rects or segments(panel) == ()


def test_fields_change_the_chosen_segment_in_one_step_per_drag(panel: Pilot) -> None:
    panel.click("timing.segment3")
    panel.draw(3)
    x, y = panel.rects["edits.segment start_speed"].center
    panel.drag((x, y), (x + 60, y))
    sent = panel.sent(ChangeSegment)
    assert sent
    assert len({command.gesture for command in sent}) == 1
    assert segments(panel)[3].start_speed == segments(panel)[3].end_speed > 0.5
    panel.click("timing.reversed")
    assert segments(panel)[3].is_reversed


def test_rows_are_put_in_another_order(panel: Pilot) -> None:
    n = len(segments(panel))
    panel.drag(panel.rects["timing.segment3"].center, panel.rects["timing.segment0"].center)
    assert panel.sent(Order) == [Order((3, 0, 1, 2, *range(4, n)))]


def test_the_take_is_played_with_a_key_or_a_button(panel: Pilot) -> None:
    timeline = panel.session.timeline
    panel.key(key.P, modifiers=(ALT,))
    assert timeline.is_take
    panel.click("timeline.take")
    assert not timeline.is_take


def test_segments_of_the_same_frames_lie_below_each_other() -> None:
    take = (Segment(0, 10), Segment(5, 15), Segment(12, 20), Segment(6, 8), Segment(6, 9), Segment(30, 31))
    assert levels_of(take) == (0, 1, 0, 2, MAX_LEVELS - 1, 0)


def test_a_cross_fade_is_no_longer_than_it_can_be() -> None:
    one = Segment(0, 10, repeats=2, crossfade_frames=5)
    assert changed_segment(one, start_speed=2.0, end_speed=2.0) == Segment(
        0, 10, 2.0, 2.0, repeats=2, crossfade_frames=2
    )
    assert changed_segment(one, repeats=1) == Segment(0, 10)
    assert changed_segment(one, start_speed=0.0) is None
