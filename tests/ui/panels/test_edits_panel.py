"""The panels of edits and of the history, markers and labels, on the made-up session."""

from __future__ import annotations

import dataclasses

import pytest
from msgspec import structs
from pyglet.window import key, mouse

from app.session.clips.clip_commands import ApplyDeletions
from app.session.edit_status import EditsStatus, HistoryStatus
from app.session.editing.edit_commands import (
    AddEdit,
    ChangeEdit,
    FillBehind,
    GoToStep,
    MoveMarker,
    PutMarker,
    RemoveEdit,
    RemoveMarker,
    RenameEdit,
    SetLabel,
    SetScale,
    SetUp,
)
from app.session.editing.mark_commands import MarkBox, MarkRegion
from app.session.editing.selection_status import SelectionStatus
from engine.editing.actions import Delete, Expose, Hide, Smooth
from engine.editing.edit import Box, Fill, Scope, Sphere
from engine.editing.fills.fill import fill_key
from engine.editing.gaussian_rows import RowSet
from engine.editing.reach import ClipAnchors
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.editing.panel import details
from ui.panels.state import EDIT, HISTORY

pytestmark = [pytest.mark.gl, pytest.mark.slow]
BOX = Box((0.0, 0.0, 0.0), (0.5, 0.4, 0.3))


@pytest.fixture
def panel(open_pilot) -> Pilot:
    """With the panel in front."""
    pilot = open_pilot(size=(1280, 1500))
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.draw(4)
    return pilot


def choose(pilot: Pilot, edit_id: int) -> None:
    pilot.click(f"edits.row{edit_id}")
    pilot.draw(2)
    assert pilot.studio.frame.ui.editing.chosen == edit_id


def test_without_a_selection_colours_and_light_change_everywhere(panel: Pilot) -> None:
    panel.click("edits.make hide")
    assert panel.sent(AddEdit) == []
    panel.session.timeline.seek(12)
    panel.click("edits.scope clip")
    panel.click("edits.make expose")
    assert panel.session.edits.edits[0].action == Expose(0.5)
    assert panel.session.edits.edits[0].scope == Scope(10, 20)
    assert panel.studio.frame.ui.editing.chosen == 1, "its details are shown at once"


def test_a_drawn_volume_is_cropped_to_and_its_handles_become_those_of_the_edit(panel: Pilot) -> None:
    ui = panel.studio.frame.ui
    ui.selecting.kind, ui.selecting.volume = "box", BOX
    panel.draw(3)
    assert "handle.face +x" in panel.rects
    panel.click("edits.outside")
    panel.click("edits.make hide")
    assert panel.sent(AddEdit) == [AddEdit(Hide(), BOX, is_inverted=True)]
    assert (ui.selecting.kind, ui.editing.is_outside) == (None, False)
    panel.draw(2)
    assert "handle.face +x" in panel.rects
    panel.key(key.ESCAPE)
    assert "handle.face +x" not in panel.rects


def test_the_details_of_a_new_edit_come_into_sight_and_stay_while_numbers_are_typed(open_pilot, monkeypatch) -> None:
    pilot = open_pilot(size=(1280, 720))
    pilot.studio.frame.ui.wanted_panel = EDIT
    pilot.draw(4)
    pilot.click("edits.make recolor")
    pilot.draw(3)
    opacity = pilot.rects["edits.opacity"]
    assert opacity.y1 < pilot.rects["viewport.canvas"].y1, "the last field is in sight, above the timeline"
    drawn: list[list[str]] = []
    real = details.numbers

    def numbers(ui, name, *arguments, **options):
        drawn[-1].append(name)
        return real(ui, name, *arguments, **options)

    def action_fields(*arguments, real=details._draw_action):
        drawn.append([])
        return real(*arguments)

    monkeypatch.setattr(details, "numbers", numbers)
    monkeypatch.setattr(details, "_draw_action", action_fields)
    x, y = pilot.rects["edits.tint_share"].center
    pilot.drag((x, y), (x + 40, y))
    assert pilot.session.edits.edits[0].action.tint_share > 0.0
    assert {tuple(names) for names in drawn} == {("tint_share", "saturation", "gains", "opacity")}
    assert pilot.rects["edits.opacity"] == opacity


def test_an_edit_that_cannot_act_is_not_offered_and_says_why(panel: Pilot) -> None:
    clips = (ClipAnchors(0, 0, 10, "a"), ClipAnchors(1, 10, 20, "b", "a"))
    panel.session.edits = dataclasses.replace(panel.session.edits, clips=clips)
    own = RowSet("b", 1, "residual")
    panel.session.selection = SelectionStatus(
        n_gaussians=3, n_shown=3, words="3 Gaussians", can_select=True, counts=((own, 3),)
    )
    panel.draw(2)
    assert "edits.note" in panel.rects, "it ends at the borders of its clip"
    panel.session.timeline.seek(12)
    panel.click("edits.scope clip")
    panel.draw(2)
    assert "edits.note" not in panel.rects
    panel.session.timeline.seek(3)
    panel.draw(2)
    assert "edits.note" in panel.rects
    panel.click("edits.make delete")
    assert panel.sent(AddEdit) == []


def test_what_was_drawn_is_marked_as_moving(panel: Pilot) -> None:
    ui = panel.studio.frame.ui
    ui.selecting.kind, ui.selecting.volume = "box", BOX
    panel.draw(2)
    panel.click("edits.make moving")
    ui.selecting.kind, ui.selecting.volume = "sphere", Sphere((1.0, 2.0, 3.0), 0.5)
    panel.draw(2)
    panel.click("edits.make moving")
    assert panel.sent(MarkBox) == [MarkBox("dynamic", (-0.5, -0.4, -0.3), (0.5, 0.4, 0.3))]
    assert panel.sent(MarkRegion) == [MarkRegion("dynamic", (1.0, 2.0, 3.0), 0.5)]


def test_details_change_name_scope_and_numbers(panel: Pilot) -> None:
    session = panel.session
    session.dispatch(AddEdit(Smooth(2.0), BOX, Scope(3, 9)))
    panel.draw(3)
    choose(panel, 1)
    panel.click("edits.name")
    panel.type("50 % ## all")
    panel.key(key.RETURN)
    assert panel.sent(RenameEdit) == [RenameEdit(1, "50 % ## all")]
    panel.click("edits.inverted")
    assert session.edits.edits[0].is_inverted
    session.timeline.seek(4)
    panel.draw(2)
    panel.click("edits.scope")
    panel.draw(3)
    panel.click("edits.choose onward")
    panel.draw(3)
    assert session.edits.edits[0].scope == Scope(4)
    n_sent = len(panel.sent(ChangeEdit))
    field = panel.rects["edits.sigma_frames"]
    panel.drag((field.x0 + 30, field.center[1]), (field.x0 + 120, field.center[1]), steps=6)
    changes = panel.sent(ChangeEdit)[n_sent:]
    assert session.edits.edits[0].action.sigma_frames > 2.5
    assert len(changes) > 1
    assert len({change.gesture for change in changes}) == 1
    assert changes[0].gesture > 0
    panel.click("edits.remove1")
    assert panel.sent(RemoveEdit) == [RemoveEdit(1)]
    panel.draw(2)
    assert panel.studio.frame.ui.editing.chosen is None


def test_deletions_are_applied_permanently_once_that_was_asked(panel: Pilot) -> None:
    panel.session.dispatch(AddEdit(Hide(), BOX))
    panel.draw(3)
    panel.click("edits.apply")
    assert panel.sent(ApplyDeletions) == [], "nothing is deleted"
    panel.session.dispatch(AddEdit(Delete(), BOX))
    panel.draw(3)
    panel.click("edits.apply")
    assert panel.sent(ApplyDeletions) == [ApplyDeletions()]
    assert not ApplyDeletions().is_confirmed


def test_names_of_users_are_shown_as_they_are(panel: Pilot) -> None:
    """ImGui would take %s for a format and ## for the end of a label."""
    for name in ("50 % %s %n", "a##b", "two\nlines", ""):
        panel.session.dispatch(AddEdit(Hide(), BOX, name=name))
    panel.draw(3)
    for edit_id in range(1, 5):
        choose(panel, edit_id)
    assert len(panel.session.notices) == 0


def test_where_nothing_can_be_edited_it_says_why(panel: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr("ui.panels.editing.panel.edit_panel.text_warning", said.append)
    panel.session.dispatch(AddEdit(Hide(), BOX))
    panel.draw(2)
    choose(panel, 1)
    panel.session.edits = dataclasses.replace(panel.session.edits, can_edit=False, why_not="It is locked.")
    panel.session.commands.clear()
    panel.draw(2)
    assert said[-1] == "It is locked."
    for name in ("edits.make expose", "edits.on1", "edits.remove1", "edits.inverted"):
        panel.click(name)
    panel.drag(panel.rects["handle.center"].center, (600.0, 300.0))
    for symbol, modifiers in ((key.DELETE, ()), (key.H, ()), (key.D, (CTRL,)), (key.DELETE, (SHIFT,))):
        panel.key(symbol, modifiers=modifiers)
    assert panel.session.commands == []


def test_keys_choose_the_scope_of_new_edits(panel: Pilot) -> None:
    ui, seen = panel.studio.frame.ui, []
    for _ in range(6):
        seen.append(ui.editing.scope)
        panel.key(key.U, modifiers=(SHIFT,))
    assert seen == ["everywhere", "frame", "range", "clip", "onward", "reference"]
    assert ui.editing.scope == "everywhere"


def test_up_and_scale_are_set_in_the_panel(panel: Pilot) -> None:
    panel.click("edits.world")
    panel.draw(3)
    panel.click("world.up")
    panel.draw(3)
    panel.click("world.up +z")
    assert panel.sent(SetUp) == [SetUp((0.0, 0.0, 1.0))]
    panel.draw(3)
    panel.click("world.view")
    assert panel.sent(SetUp)[1].direction == pytest.approx(tuple(-panel.session.view.world_to_camera()[1, :3]))
    panel.move(*panel.rects["world.scale"].center)
    panel.press()
    panel.release()
    panel.draw(2)
    panel.key(key.A, modifiers=(CTRL,))
    panel.type("0.25")
    panel.key(key.RETURN)
    assert panel.sent(SetScale) == [SetScale(0.25)]
    panel.click("world.ground")
    assert panel.studio.frame.ui.editing.asking == "ground"


def test_the_history_goes_to_any_step(panel: Pilot) -> None:
    panel.session.history = HistoryStatus("c", "d", ("a ## 50 %", "b", "c"), ("d", "e"))
    panel.studio.frame.ui.wanted_panel = HISTORY
    panel.draw(4)
    panel.click("history.step1")
    panel.click("history.step3")
    panel.click("history.step5")
    assert panel.sent(GoToStep) == [GoToStep(-2), GoToStep(2)], "the present one is where it is"
    assert len(panel.session.notices) == 0


def test_a_marker_is_dragged_and_removed_by_key(panel: Pilot) -> None:
    timeline = panel.session.timeline
    panel.session.dispatch(PutMarker(7, "foul"))
    panel.session.dispatch(PutMarker(21, "goal"))
    panel.draw(2)
    x, y = panel.rects["timeline.marker7"].center
    per_frame = (panel.rects["timeline.marker21"].center[0] - x) / 14
    panel.drag((x, y), (x + 3 * per_frame, y), steps=9)
    assert timeline.markers.frames == [10, 21]
    assert timeline.frame_index == 10
    assert len({command.gesture for command in panel.sent(MoveMarker)}) == 1
    x = panel.rects["timeline.marker10"].center[0]
    panel.drag((x, y), (x + 11 * per_frame, y), steps=22)
    assert timeline.markers.frames == [20, 21], "it does not go onto another one"
    panel.key(key.M, modifiers=(CTRL, SHIFT))
    assert panel.sent(RemoveMarker) == [RemoveMarker(20)]
    assert timeline.markers.frames == [21]


def test_clips_and_cameras_get_names_of_the_users_own(panel: Pilot) -> None:
    for menu, field, kind, name in (
        ("timeline.clip1", "label.clip", "clip", "10"),
        ("capture.camera2", "label.camera", "camera", "cam02"),
    ):
        panel.move(*panel.rects[menu].center)
        panel.press(mouse.RIGHT)
        panel.release(mouse.RIGHT)
        panel.draw(3)
        panel.click(field)
        panel.type("50 % ## %s")
        panel.key(key.RETURN)
        assert panel.session.edits.label(kind, name) == "50 % ## %s"
        panel.key(key.ESCAPE)
        panel.key(key.ESCAPE)
        panel.draw(3)
    labels = [command for command in panel.sent(SetLabel) if command.kind == "clip"]
    assert len({command.gesture for command in labels}) == 1
    assert len(panel.session.notices) == 0


def test_without_a_capture_both_panels_say_so(open_pilot) -> None:
    from tests.ui.fake_session import FakeSession

    pilot = open_pilot(FakeSession(has_capture=False))
    for title in (EDIT, HISTORY):
        pilot.studio.frame.ui.wanted_panel = title
        pilot.draw(3)
    assert pilot.session.edits == EditsStatus(why_not="Open a capture first.")
    assert len(pilot.session.notices) == 0


def test_what_takes_something_away_is_filled_behind(panel: Pilot) -> None:
    ui = panel.studio.frame.ui
    ui.selecting.kind, ui.selecting.volume = "box", BOX
    panel.draw(3)
    panel.click("edits.make delete")
    panel.draw(3)
    panel.click("edits.fill")
    assert panel.sent(FillBehind) == [FillBehind(1)]
    assert "edits.remove_fill" not in panel.rects
    edit = panel.session.edits.edits[0]
    panel.session.dispatch(ChangeEdit(structs.replace(edit, fill=Fill(fill_key(edit)))))
    panel.draw(3)
    panel.click("edits.remove_fill")
    assert panel.session.edits.edits == (edit,)


def test_only_what_takes_something_away_has_a_fill(panel: Pilot) -> None:
    panel.click("edits.make expose")
    panel.draw(3)
    assert "edits.fill" not in panel.rects
