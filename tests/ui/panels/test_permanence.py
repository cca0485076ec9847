"""Applying deletions permanently by pointer: the button, what is asked, and edits that have lost their picks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.session.clips.clip_commands import ApplyDeletions
from app.session.clips.clip_questions import DeletionsQuestion
from app.session.commands import CloseQuestion
from app.session.edit_status import EditsStatus
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Edit, Picked, PickedRows, Sphere
from engine.editing.lost_picks import LostPicks
from engine.editing.picks import pack_rows
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.panels.state import EDIT

pytestmark = pytest.mark.gl

DELETES = Edit(1, "", Sphere((0.0, 0.0, 0.0), 1.0), Delete())
BRIGHTENS = Edit(2, "", Picked((PickedRows(1, "before", "residual", pack_rows(np.arange(3))),)), Expose(1.0))


@pytest.fixture
def panel(open_pilot: Callable[..., Pilot]) -> Pilot:
    pilot = open_pilot(FakeSession(), size=(1280, 1400))
    show(pilot, DELETES, BRIGHTENS)
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.draw(4)
    return pilot


def show(pilot: Pilot, *edits: Edit, lost: tuple[LostPicks, ...] = ()) -> None:
    pilot.session.edits = EditsStatus(edits, can_edit=True, lost=lost)
    pilot.draw(3)


def test_the_button_works_where_something_is_deleted(panel: Pilot) -> None:
    panel.click("edits.apply")
    assert panel.session.commands[-1] == ApplyDeletions()
    show(panel, BRIGHTENS)
    n_before = panel.session.commands.count(ApplyDeletions())
    panel.click("edits.apply")
    assert panel.session.commands.count(ApplyDeletions()) == n_before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("button", "command"), [("question.no", CloseQuestion()), ("question.yes", ApplyDeletions(is_confirmed=True))]
)
def test_it_is_asked_before_clips_are_written(panel: Pilot, button: str, command: object) -> None:
    panel.session.question = DeletionsQuestion(n_anchors=1234, n_clips=3, n_untrained=0)
    panel.draw(4)
    n_before = len(panel.session.commands)
    panel.click(button)
    assert panel.session.commands[n_before] == command  # the made-up session goes on asking


@pytest.mark.slow
def test_an_edit_that_has_lost_its_picks_looks_otherwise(panel: Pilot) -> None:
    before = panel.picture()
    show(panel, DELETES, BRIGHTENS, lost=(LostPicks(2, (1,), is_all=True),))
    rect, after = panel.rects["edits.row2"], panel.picture()
    inside = np.s_[int(rect.y0) : int(rect.y1), int(rect.x0) : int(rect.x1)]
    assert (before[inside] != after[inside]).any()
