"""Where edits act: where their scope meets clips that have what they act on; and the words for it."""

from __future__ import annotations

import pytest

from app.document.changes.reach_words import acting_text, check_acts, frames_text, reach_note
from engine.editing.edit import EVERYWHERE, Scope
from engine.editing.gaussian_rows import RowSet
from engine.editing.reach import UNKNOWN, ClipAnchors, Reach, reach_of
from engine.errors import ProjectError

CLIPS = (
    ClipAnchors(0, 0, 10, "ref"),
    ClipAnchors(1, 10, 20, "one", "ref"),
    ClipAnchors(2, 20, 30, "two", "ref"),
    ClipAnchors(3, 30, 35, "", "ref"),
)
STILL, MOVING = (RowSet("ref", 0, "static"), 100), (RowSet("ref", 0, "moving"), 20)
ONE = RowSet("one", 1, "residual"), 50
HINT = " An object made of it acts in all clips, and so does a box or sphere."


def note(*picked: tuple[RowSet, int], scope: Scope = EVERYWHERE, is_inverted: bool = False) -> str:
    return reach_note(reach_of(picked, scope, CLIPS, is_inverted=is_inverted), scope)


def test_a_volume_acts_wherever_its_scope_lies_within_the_capture() -> None:
    assert reach_of((), Scope(5, 25), CLIPS) == Reach(((5, 25),), exists=((0, 35),))
    assert reach_of((), Scope(5), CLIPS).acts == ((5, 35),)
    assert note(scope=Scope(5, 25)) == ""
    assert note(scope=Scope(40)) == "The edit can never act (from 40 on): the capture has frames 0-34 only."


def test_what_clips_inherit_is_there_in_all_of_them() -> None:
    assert reach_of([STILL], EVERYWHERE, CLIPS).acts == ((0, 35),)
    assert note(STILL) == ""
    assert note(STILL, scope=Scope(12, 40, is_reference_only=True)) == ""


def test_what_a_clip_has_learned_itself_ends_at_its_borders() -> None:
    reach = reach_of([ONE], Scope(5, 25), CLIPS)
    assert (reach.acts, reach.exists, reach.is_whole, reach.n_ending) == (((10, 20),), ((10, 20),), False, 50)
    assert note(ONE, scope=Scope(5, 25)) == "Acts in frames 10-19 only: other clips have other Gaussians." + HINT
    assert acting_text(Scope(5, 25), reach) == "frames 10-19 only"
    assert note(ONE, scope=Scope(12, 18)) == ""


def test_how_much_of_a_selection_ends_is_said() -> None:
    reach = reach_of([STILL, ONE], EVERYWHERE, CLIPS)
    assert (reach.acts, reach.is_whole, reach.n_picked, reach.n_ending, reach.ending) == (
        ((0, 35),),
        True,
        150,
        50,
        ((10, 20),),
    )
    words = "50 of 150 Gaussians are in frames 10-19 only: other clips have other Gaussians."
    assert note(STILL, ONE) == words + HINT
    assert acting_text(EVERYWHERE, reach) == "everywhere; 33 % in frames 10-19 only"


def test_other_clips_show_what_moves_by_gaussians_of_their_own_too() -> None:
    assert note(MOVING) == (
        "Other clips show what moves partly with their own Gaussians, which are not selected." + HINT
    )
    assert note(MOVING, scope=Scope(0, 10)) == ""
    assert note(MOVING, scope=Scope(is_reference_only=True)) == "", "that is what was asked for"


@pytest.mark.parametrize("scope", [Scope(20, 30), Scope(is_reference_only=True)])
def test_an_edit_that_can_never_act_is_refused(scope: Scope) -> None:
    reach = reach_of([ONE], scope, CLIPS)
    assert reach.is_nowhere
    with pytest.raises(ProjectError, match="the selection exists in frames 10-19 only"):
        check_acts(reach, scope)
    assert acting_text(scope, reach).startswith("acts in no frame (")


def test_a_selection_that_is_inverted_means_everything_where_it_is_not() -> None:
    reach = reach_of([ONE], Scope(5, 25), CLIPS, is_inverted=True)
    assert (reach.acts, reach.empty) == (((5, 25),), ((5, 10), (20, 25)))
    words = "The selection does not exist in frames 5-9 and 20-24; there the edit acts on everything."
    assert note(ONE, scope=Scope(5, 25), is_inverted=True) == words
    assert note(STILL, is_inverted=True) == ""


def test_nothing_is_said_of_what_is_not_known() -> None:
    lost = RowSet("older", 1, "residual"), 5
    assert reach_of([lost], Scope(50), CLIPS) == UNKNOWN
    assert reach_of([ONE], Scope(50), ()) == UNKNOWN
    check_acts(UNKNOWN, EVERYWHERE)
    assert (reach_note(UNKNOWN, Scope(3, 5)), acting_text(Scope(3, 5), UNKNOWN)) == ("", "frames 3-4")


def test_independent_clips_have_what_is_their_own() -> None:
    clips = (ClipAnchors(0, 0, 10, "a"), ClipAnchors(1, 10, 20, "b"))
    reach = reach_of([(RowSet("b", 1, "static"), 5)], Scope(is_reference_only=True), clips)
    assert reach.acts == ((10, 20),)


def test_runs_in_words() -> None:
    assert frames_text(((3, 4),)) == "frame 3"
    assert frames_text(((3, 4), (6, 8))) == "frames 3 and 6-7"
    assert frames_text(((0, 2), (3, 5), (6, 8), (9, 11))) == "frames 0-1, 3-4, 6-7 and more"
