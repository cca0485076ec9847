"""The window always finishes drawing: what stands on the screen when the loop rests is what more frames would show."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pyglet.window import key, mouse

from app.session.showing.look_commands import SetFrame, TogglePlay
from app.status import ClipStatus
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.shell.redraw import FRAMES_AFTER_CHANGE, FRAMES_AFTER_INPUT, MAX_SETTLING, RedrawPlan

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def assert_finished(pilot: Pilot) -> np.ndarray:
    """Many more frames change nothing. Returns the picture."""
    shown = pilot.picture()
    for _ in range(8):
        pilot.studio.frame.forget_shown()
        pilot.studio.draw()
    np.testing.assert_array_equal(pilot.picture(), shown)
    return shown


@pytest.mark.parametrize("has_capture", [False, True])
def test_the_first_screen_is_complete_without_any_event(open_pilot: Callable[..., Pilot], *, has_capture: bool) -> None:
    pilot = open_pilot(FakeSession(has_capture=has_capture), first_frames=0)
    pilot.rest()
    assert_finished(pilot)


def test_a_capture_that_was_opened_is_drawn_completely_without_any_event(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession(has_capture=False)
    pilot = open_pilot(session, first_frames=0)
    pilot.rest()
    opened = FakeSession()
    for name in ("capture", "rig", "clips", "clip_states", "timeline", "views", "regions"):
        setattr(session, name, getattr(opened, name))
    news = iter([True])
    session.poll = lambda: next(news, False)  # the session says once that something is new, as it does
    pilot.rest()
    assert "timeline.track" in pilot.rects
    assert_finished(pilot)


def test_a_menu_is_drawn_after_a_tap(pilot: Pilot) -> None:
    for name, item in (("menu.View", "menu.scale"), ("viewport.overlays", "show.show_frusta")):
        pilot.rest()
        before = pilot.picture()
        pilot.tap(*pilot.rects[name].center)
        rect = pilot.rects[item]
        shown = assert_finished(pilot)
        x, y = (round(value) for value in rect.center)
        assert (shown[y - 30 : y + 30, x - 60 : x + 60] != before[y - 30 : y + 30, x - 60 : x + 60]).mean() > 0.3
        pilot.key(key.ESCAPE)


def test_the_menu_of_a_clip_is_drawn_after_a_tap_with_the_right_button(pilot: Pilot) -> None:
    pilot.session.clip_states[1] = ClipStatus("trained", 1.0)
    pilot.rest()
    before = pilot.picture()
    x, y = pilot.rects["timeline.clip1"].center
    pilot.tap(x, y, mouse.RIGHT)
    shown = assert_finished(pilot)
    assert (shown != before).any(axis=2).sum() > 5_000, "a menu covers that many pixels"


def test_nothing_is_drawn_twice_and_nothing_at_all_at_rest(pilot: Pilot) -> None:
    pilot.rest()
    assert not pilot.studio.frame.draw(), "the same frame again is not drawn over itself"
    pilot.session.timeline.seek(7)
    assert pilot.studio.frame.draw()


@pytest.mark.parametrize("name", ["menu.File", "menu.View", "menu.Train", "menu.Mark", "menu.Window"])
def test_escape_closes_a_menu_and_does_nothing_else(pilot: Pilot, name: str) -> None:
    pilot.key(key.M)
    pilot.rest()
    pilot.tap(*pilot.rects[name].center)
    stack = pilot.studio.frame.backend.context.open_popup_stack
    assert len(stack) == 1
    pilot.key(key.ESCAPE)
    assert len(stack) == 0
    assert pilot.studio.frame.ui.regions.is_active, "the sphere that is being chosen stays"


def test_escape_closes_the_menu_of_a_clip_and_the_show_popup(pilot: Pilot) -> None:
    stack = pilot.studio.frame.backend.context.open_popup_stack
    pilot.tap(*pilot.rects["timeline.clip1"].center, mouse.RIGHT)
    assert len(stack) == 1
    pilot.key(key.ESCAPE)
    assert len(stack) == 0
    button = pilot.rects["viewport.overlays"]
    pilot.tap(*button.center)
    assert len(stack) == 1
    assert pilot.rects["show.show_frusta"].y0 > button.y1, "it leaves its button free"
    pilot.key(key.ESCAPE)
    assert len(stack) == 0


@pytest.mark.parametrize("symbol", [key.F10, key.LALT])
def test_menus_work_with_the_keyboard_alone(pilot: Pilot, symbol: int) -> None:
    frame_index = pilot.session.timeline.frame_index
    pilot.key(symbol)
    pilot.rest()
    assert "menu.Quit; training progress is kept" in pilot.rects
    pilot.key(key.RIGHT)
    pilot.rest()
    assert "menu.Hide the selection" in pilot.rects, "Right goes on to the next menu"
    pilot.key(key.LEFT)
    pilot.rest()
    pilot.key(key.UP)  # from the first entry round to the last
    pilot.key(key.ENTER)
    pilot.rest()
    assert pilot.studio.frame.ui.quit_requested, "the last entry was chosen"
    assert pilot.sent(SetFrame) == pilot.sent(TogglePlay) == []
    assert pilot.session.timeline.frame_index == frame_index
    pilot.key(key.RIGHT)
    assert pilot.session.timeline.frame_index == frame_index + 1, "with no menu open the arrows move through time"


def test_forty_characters_typed_at_once_stand_there_after_one_frame(
    open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.key(key.O, modifiers=(key.LCTRL,))
    pilot.draw(3)
    pilot.key(key.A, modifiers=(key.LCTRL,))
    typed = "/somewhere/in/a/folder/with/a/long/name_"
    for character in typed:
        symbol = getattr(key, {"/": "SLASH", "_": "UNDERSCORE"}.get(character, character.upper()))
        pilot.studio.window.dispatch_event("on_key_press", symbol, 0)
        pilot.studio.window.dispatch_event("on_text", character)
        pilot.studio.window.dispatch_event("on_key_release", symbol, 0)
    pilot.draw(2)
    assert pilot.studio.frame.dialog._text == typed


def test_a_change_asks_for_more_frames_and_something_restless_is_left_alone() -> None:
    plan = RedrawPlan()
    plan.request()
    for _ in range(FRAMES_AFTER_INPUT + FRAMES_AFTER_CHANGE):
        plan.note_drawn(1)
    assert not plan.is_due
    plan.request(1)
    plan.note_drawn(2)
    assert plan.is_due, "it differs from the frame before"
    plan.note_drawn(2)
    plan.note_drawn(2)
    assert not plan.is_due
    plan.request(1)
    drawn = 0
    while plan.is_due:
        drawn += 1
        plan.note_drawn(100 + drawn)
    assert MAX_SETTLING <= drawn <= MAX_SETTLING + FRAMES_AFTER_CHANGE
    plan.request(1)
    plan.note_drawn(3, has_more_input=True)
    assert plan.is_due
