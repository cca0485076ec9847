"""Keys as a keyboard sends them: in any order of release, faster than frames are drawn, and faster than boxes open."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pyglet.window import key

from app.session.projects.project_commands import OpenCapture
from app.session.showing.look_commands import SetMode
from app.session.training.train_commands import TrainNextClip
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.actions.table import ACTIONS
from ui.shell.input_queue import MOST_HELD_FRAMES, InputQueue

SYMBOLS = {"/": key.SLASH, "_": key.UNDERSCORE, "-": key.MINUS, ".": key.PERIOD}


class Keyboard:
    """Tells a window of keys as pyglet does on X11: a name that counts as pressed is not pressed again."""

    def __init__(self, pilot: Pilot) -> None:
        self._window = pilot.studio.window
        self._window.pressed_keys = set()

    def down(self, symbol: int, text: str = "") -> None:
        if symbol not in self._window.pressed_keys:
            self._window.dispatch_event("on_key_press", symbol, 0)
            self._window.pressed_keys.add(symbol)
        if text:
            self._window.dispatch_event("on_text", text)

    def up(self, symbol: int) -> None:
        self._window.dispatch_event("on_key_release", symbol, 0)
        self._window.pressed_keys.discard(symbol)

    def chord(self, *symbols: int) -> None:
        for symbol in symbols:
            self.down(symbol)
        for symbol in reversed(symbols):
            self.up(symbol)

    def type(self, text: str) -> None:
        for sign in text:
            symbol = SYMBOLS.get(sign, ord(sign.lower()))
            self.down(symbol, sign)
            self.up(symbol)


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.parametrize("two_with_shift", [key.AT, key.DOUBLEQUOTE])  # American and German
@pytest.mark.parametrize("is_shift_first", [True, False])
def test_every_press_of_a_shifted_digit_counts(pilot: Pilot, two_with_shift: int, is_shift_first: bool) -> None:
    keyboard = Keyboard(pilot)
    pressed: list[int] = []
    pilot.studio.window.push_handlers(on_key_press=lambda symbol, modifiers: pressed.append(symbol))
    for _ in range(3):
        keyboard.down(SHIFT)
        keyboard.down(two_with_shift, "@")
        pilot.draw()
        for symbol in (SHIFT, key._2) if is_shift_first else (two_with_shift, SHIFT):
            keyboard.up(symbol)
        pilot.draw(2)
    assert pressed.count(two_with_shift) == 3
    if two_with_shift == key.AT:
        assert len(pilot.sent(SetMode)) == 3
    assert not pilot.studio.window.pressed_keys


@pytest.fixture
def empty(open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch) -> Pilot:
    """A window in which folders are asked for by its own box."""
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    return open_pilot(FakeSession())


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.parametrize("is_all_selected", [False, True])
def test_what_is_typed_right_after_ctrl_o_arrives_however_late_the_next_frame_is(
    empty: Pilot, tmp_path: Path, is_all_selected: bool
) -> None:
    folder = tmp_path / "torso_take-2.t"
    folder.mkdir()
    keyboard = Keyboard(empty)
    keyboard.chord(CTRL, key.O)
    if is_all_selected:
        keyboard.chord(CTRL, key.A)
    keyboard.type(str(folder))  # letters of it are keys that train, mark and compare
    keyboard.chord(key.RETURN)
    empty.draw(12)
    assert empty.sent(OpenCapture) == [OpenCapture(folder, is_asking=True)]
    assert empty.sent(TrainNextClip) == []


@pytest.mark.gl
@pytest.mark.slow
def test_a_key_right_after_the_one_that_closes_a_menu_counts(empty: Pilot, tmp_path: Path) -> None:
    empty.key(key.F10)
    empty.draw(4)
    keyboard = Keyboard(empty)
    for _ in range(3):  # the menu, and the bar
        keyboard.chord(key.ESCAPE)
    keyboard.chord(CTRL, key.O)
    keyboard.type(str(tmp_path))
    keyboard.chord(key.RETURN)
    empty.draw(30)
    assert empty.sent(OpenCapture) == [OpenCapture(tmp_path, is_asking=True)]


@pytest.mark.gl
@pytest.mark.slow
def test_typing_into_a_box_that_was_opened_again_replaces_what_it_held(empty: Pilot, tmp_path: Path) -> None:
    keyboard = Keyboard(empty)
    keyboard.chord(CTRL, key.O)
    keyboard.type("/nowhere")
    keyboard.chord(key.ESCAPE)
    empty.draw(12)
    keyboard.chord(CTRL, key.O)
    keyboard.type(str(tmp_path))
    keyboard.chord(key.RETURN)
    empty.draw(12)
    assert empty.sent(OpenCapture) == [OpenCapture(tmp_path, is_asking=True)]


@pytest.mark.gl
@pytest.mark.slow
def test_a_letter_that_opens_a_box_is_not_typed_into_it(pilot: Pilot) -> None:
    palette = next(action for action in ACTIONS if action.id == "window.palette")
    pilot.studio.frame.ui.keys.assign(palette, "Y", ACTIONS)
    keyboard = Keyboard(pilot)
    keyboard.type("yquit")
    pilot.draw(12)
    assert pilot.studio.frame.palette._typed == "quit"
    assert not pilot.studio.frame.ui.quit_requested


def test_events_wait_for_the_frame_of_a_key_and_keep_their_order() -> None:
    queue, passed = InputQueue(), []

    def event(name: str, *, ends: bool = False) -> None:
        queue.add(lambda: passed.append(name) or ends)

    event("move")
    event("Ctrl+A", ends=True)
    event("release")
    event("typed")
    assert passed == ["move", "Ctrl+A"]
    queue.after_frame(is_held=True)
    assert passed == ["move", "Ctrl+A"]
    queue.after_frame(is_held=False)
    assert passed == ["move", "Ctrl+A", "release", "typed"]
    event("Ctrl+O", ends=True)
    event("late")
    for _ in range(MOST_HELD_FRAMES + 1):
        queue.after_frame(is_held=True)
    assert passed[-1] == "late", "what does not come up takes no keys for ever"


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.usefixtures("lasting_notices")
def test_a_key_that_cannot_act_says_why_once(pilot: Pilot) -> None:
    keys = ((key.X, key.LALT), (key.N, SHIFT), (key.UP, SHIFT), (key._3, CTRL), (key.V, SHIFT), (key.Z, CTRL))
    for n, (symbol, modifier) in enumerate(keys, 1):
        for _ in range(3):
            pilot.key(symbol, modifiers=(modifier,))
        assert [notice.kind for notice in pilot.session.notices] == ["info"] * n
    assert len({notice.title for notice in pilot.session.notices}) == len(keys)


@pytest.mark.gl
@pytest.mark.slow
def test_a_key_that_ends_what_has_not_begun_says_nothing(pilot: Pilot) -> None:
    for symbol in (key.ESCAPE, key.ENTER, key.PAGEUP):
        pilot.key(symbol)
    assert len(pilot.session.notices) == 0


@pytest.mark.gl
@pytest.mark.slow
def test_what_cannot_act_is_disabled_in_menus_too(pilot: Pilot) -> None:
    ui = pilot.studio.frame.ui
    why_not = {action.id: action.why_not(pilot.session, ui) for action in ACTIONS}
    queue = [name for name in why_not if name.startswith("queue.")]
    assert len(queue) == 5
    assert all(why_not[name] for name in queue), "nothing waits, and nothing has failed"
    assert not why_not["train.next"]
