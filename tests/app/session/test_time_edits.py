"""Changes of time through the session: named steps, merged drags, refusals as notices, and the timeline follows."""

from __future__ import annotations

import pytest

from app.document.changes.timing_changes import ChangeSegment, ChangeSpeed, Loop, ResetTime, Split, Trim
from app.session.editing.edit_commands import Redo, Undo
from engine.timing.segment import Segment
from engine.timing.timing import TakeTiming


@pytest.fixture
def session(make_session):
    return make_session()


def test_steps_have_names_and_the_timeline_follows_them(session) -> None:
    n_frames = session.timeline.n_frames
    assert session.timeline.timing is None
    session.dispatch(Trim((1, 4)))
    session.dispatch(Split(2))
    session.dispatch(ChangeSpeed((2, 4), 0.5))
    take = (Segment(1, 2), Segment(2, 4, 0.5, 0.5))
    assert session.edits.timing == take
    assert session.timeline.timing == TakeTiming(take, n_frames)
    assert session.history.past == ("trim to frames 1 to 3", "split at frame 2", "speed 0.5 of frames 2 to 3")
    assert "speed --frames 2:4 --by 0.5" in session.command_texts.step().shell(is_windows=False)
    session.dispatch(Undo())
    assert session.edits.timing == (Segment(1, 2), Segment(2, 4))
    session.dispatch(Redo())
    assert session.edits.timing == take
    session.dispatch(ResetTime())
    assert (session.edits.timing, session.timeline.timing) == ((), None)


def test_a_drag_is_one_step_and_the_same_again_is_none(session) -> None:
    session.dispatch(Trim((1, 4)))
    for speed in (1.1, 1.2, 1.3):
        session.dispatch(ChangeSegment(0, Segment(1, 4, speed, speed), 7))
    assert session.history.past == ("trim to frames 1 to 3", "change segment 0")
    session.dispatch(Trim((1, 4)))
    assert len(session.history.past) == 2


def test_what_cannot_be_becomes_a_notice(session) -> None:
    session.dispatch(Loop((0, 2), 2, 2))
    assert session.edits.timing == ()
    assert "The take cannot be changed" in [notice.title for notice in session.notices]
