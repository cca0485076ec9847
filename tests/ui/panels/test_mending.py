"""The window of mending: what it shows in each state, and what its buttons and keys send."""

from __future__ import annotations

import numpy as np
import pytest
from pyglet.window import key

from app.mending.request import MendRequest
from app.project.mends.record import MendedClip, MendRecord
from app.session.mending.mend_commands import AskMend, CloseMend, CompareMended, RevertMend, StartMend, StopMend
from app.session.mending.mend_page import MendPage
from app.status import JobStatus
from engine.mending.figures import Attempt, StretchFigures
from tests.ui.pilot import SHIFT, Pilot

BEFORE = StretchFigures(0.4, 0.5, 0.2, {"1": 29.0, "2": 30.0}, 0.45, {"1": 28.0, "2": 28.5})
AFTER = StretchFigures(0.1, 0.2, 0.2, {"1": 29.5, "2": 30.0}, 0.12, {"1": 28.4, "2": 28.5})
RECORD = MendRecord(
    "the seam at frame 20",
    16,
    24,
    (MendedClip(1, "old", "new"),),
    BEFORE,
    AFTER,
    (Attempt("fade", "4 frames of clip 1 go over", AFTER, True, 4.0),),
    "What can move jumps.",
    "",
    12.0,
)
ASKING = MendPage(MendRequest(after=2), "the seam at frame 20", 20, (1, 2), estimate_s=40.0)
DONE = MendPage(MendRequest(after=2), "the seam at frame 20", 20, (1, 2), "done", record=RECORD, number=1)


def show(pilot: Pilot, page: MendPage | None) -> None:
    pilot.session.mending.page = page
    pilot.draw(3)


def test_nothing_is_drawn_while_nothing_is_mended(pilot: Pilot) -> None:
    pilot.draw(2)
    assert "mend" not in pilot.rects
    pilot.key(key.K, modifiers=(key.LALT,))
    assert not pilot.sent(CloseMend)


@pytest.mark.parametrize("method", ["auto", "light", "fade", "joint"])
def test_every_way_to_mend_has_a_button(pilot: Pilot, method: str) -> None:
    show(pilot, ASKING)
    pilot.click(f"mend.{method}")
    assert pilot.sent(StartMend) == [StartMend(method)]


def test_what_cannot_be_mended_cannot_be_begun(pilot: Pilot) -> None:
    show(pilot, MendPage(ASKING.request, ASKING.words, 20, (1, 2), why_not="Clip 1 is not trained."))
    pilot.click("mend.auto")
    assert not pilot.sent(StartMend)


def test_a_key_asks_about_the_nearest_seam_and_begins(pilot: Pilot) -> None:
    clips = pilot.session.timeline.clips
    pilot.session.timeline.seek(clips[2].start + 1)
    pilot.key(key.M, modifiers=(SHIFT,))
    assert pilot.sent(AskMend) == [AskMend(after=2)]
    show(pilot, ASKING)
    pilot.key(key.M, modifiers=(SHIFT,))
    assert pilot.sent(StartMend) == [StartMend()]


def test_a_key_means_the_seam_that_is_played_around(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    timeline.play_around(timeline.clips[2].start)
    timeline.hold()
    pilot.key(key.M, modifiers=(SHIFT,))  # the playhead stands nearer to the seam before
    assert pilot.sent(AskMend) == [AskMend(after=2)]


@pytest.mark.slow
def test_escape_closes_what_lies_on_top_and_leaves_the_tool_after_that(pilot: Pilot) -> None:
    tool = pilot.studio.frame.ui.selecting
    tool.choose("lasso")
    show(pilot, ASKING)
    pilot.key(key.ESCAPE)
    assert pilot.sent(CloseMend) == [CloseMend()]
    assert tool.kind == "lasso"
    show(pilot, None)
    pilot.key(key.ESCAPE)
    assert tool.kind is None
    show(pilot, DONE)  # which is kept or taken back by its buttons
    pilot.key(key.ESCAPE)
    assert pilot.sent(CloseMend) == [CloseMend()]


def test_it_leaves_room_for_what_a_tool_says(pilot: Pilot) -> None:
    show(pilot, ASKING)
    assert pilot.rects["mend"].y0 >= pilot.rects["viewport.free"].y0 + 60


def test_what_runs_shows_how_far_it_is_and_can_be_stopped(pilot: Pilot) -> None:
    pilot.session.mending.progress = JobStatus("Mending", 0.4, "Fading - clip 1, step 10 of 480")
    show(pilot, MendPage(ASKING.request, ASKING.words, 20, (1, 2), "running"))
    pilot.click("mend.stop")
    pilot.key(key.K, modifiers=(key.LALT,))
    assert len(pilot.sent(StopMend)) == 2
    assert not pilot.sent(CloseMend)


@pytest.mark.slow
def test_a_result_can_be_compared_taken_back_and_kept(pilot: Pilot) -> None:
    show(pilot, DONE)
    for name, kind in (("compare", CompareMended), ("revert", RevertMend), ("keep", CloseMend)):
        pilot.click(f"mend.{name}")
        assert len(pilot.sent(kind)) == 1
    pilot.key(key.B, modifiers=(key.LALT,))
    pilot.key(key.Z, modifiers=(key.LALT, SHIFT))
    assert (len(pilot.sent(CompareMended)), len(pilot.sent(RevertMend))) == (2, 2)


def test_it_makes_room_for_what_is_compared(pilot: Pilot) -> None:
    show(pilot, DONE)
    whole = pilot.rects["mend"].height
    show(pilot, MendPage(DONE.request, DONE.words, 20, (1, 2), "done", record=RECORD, number=1, compared=1))
    assert pilot.rects["mend"].height < 0.5 * whole


def test_figures_of_hostile_words_are_drawn_as_they_are(pilot: Pilot) -> None:
    words = "%s%n ##\nwhat"
    record = MendRecord(words, 16, 24, RECORD.clips, BEFORE, AFTER, RECORD.attempts, words, words, 12.0)
    show(pilot, MendPage(DONE.request, words, 20, (1, 2), "done", record=record, number=1, failure=words))
    assert pilot.rects["mend"].height > 200
    assert not [notice for notice in pilot.session.notices if "could not be drawn" in notice.title]


@pytest.mark.slow
def test_a_seam_has_a_menu_in_the_list_of_residuals(pilot: Pilot) -> None:
    from pyglet.window import mouse

    pilot.studio.frame.ui.wanted_panel = "Residuals"
    pilot.draw(4)
    pilot.move(*pilot.rects["residuals.seam2"].center)
    pilot.press(mouse.RIGHT)
    pilot.release(mouse.RIGHT)
    pilot.draw(3)
    pilot.click("residuals.mend2")
    assert pilot.sent(AskMend) == [AskMend(after=2)]
    assert np.isfinite(pilot.picture()).all()
