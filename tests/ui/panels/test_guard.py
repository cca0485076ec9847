"""Every panel, dialog and view mode made to fail anywhere: one notice, one entry in the log, and the rest goes on."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from imgui_bundle import imgui, implot
from pyglet.window import key

from app.playback.modes.view_modes import MODES
from app.session.questions import RetrainQuestion
from app.session.showing.look_commands import ActivateView, SetCompare, SetMode, ShowViews
from app.status import ClipStatus
from tests.ui.pilot import CTRL, Pilot
from ui.panels.guard import logger
from ui.panels.state import PANELS, TIMELINE, VIEWPORT
from ui.viewport.scene import SceneView, ViewportScene

pytestmark = [pytest.mark.gl, pytest.mark.slow]

PLACES = 12
"""So many calls of each panel are made to fail, one after the other."""
_HARMLESS = ("get_", "is_", "calc_", "color_", "end", "pop")
"""Calls that ask something, and those that end what was begun."""


class Sabotage:
    """Makes one call of Dear ImGui inside of one function raise.

    Attributes:
        n_calls: Of the newest run of the function, up to where it failed.
        fails_at: The number of the call that raises, counted from 1; None for none.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.n_calls, self._is_inside = 0, False
        self.fails_at: int | None = None
        for module, name in itertools.chain(*([(module, name) for name in dir(module)] for module in (imgui, implot))):
            call = getattr(module, name)
            if name[0].islower() and callable(call) and not name.startswith(_HARMLESS):
                monkeypatch.setattr(module, name, self._watched(call))

    def inside(self, draw: Callable[..., Any]) -> Callable[..., Any]:
        """The function, watched."""

        def watched(*arguments: Any, **named: Any) -> Any:
            self.n_calls, self._is_inside = 0, True
            try:
                return draw(*arguments, **named)
            finally:
                self._is_inside = False

        return watched

    def _watched(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*arguments: Any, **named: Any) -> Any:
            self.n_calls += self._is_inside
            if self._is_inside and self.n_calls == self.fails_at:
                raise RuntimeError("broken on purpose")
            return call(*arguments, **named)

        return watched


@pytest.fixture
def sabotage(monkeypatch: pytest.MonkeyPatch) -> Sabotage:
    return Sabotage(monkeypatch)


@pytest.fixture
def told(caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]) -> Callable[[Pilot], list[str]]:
    """Titles of notices about faults; the log must have as many entries, and Dear ImGui must not have said a word."""

    def titles(pilot: Pilot) -> list[str]:
        found = [notice.title for notice in pilot.session.notices if notice.kind == "error"]
        assert len([record for record in caplog.records if record.name == logger.name]) == len(found)
        assert "imgui-error" not in "".join(capfd.readouterr())
        return found

    return titles


def _replace_panel(pilot: Pilot, title: str, wrap: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
    frame = pilot.studio.frame
    frame._panels = tuple((name, wrap(draw) if name == title else draw, room) for name, draw, room in frame._panels)
    frame.ui.wanted_panel = title
    pilot.draw(4)


def _forget(pilot: Pilot, caplog: pytest.LogCaptureFixture) -> None:
    for notice in pilot.session.notices:
        pilot.session.notices.withdraw(notice)
    caplog.clear()
    pilot.draw(2)


@pytest.mark.parametrize("title", [*PANELS, VIEWPORT])
def test_a_panel_that_fails_anywhere_costs_one_notice_and_leaves_nothing_open(
    pilot: Pilot, sabotage: Sabotage, told: Callable[[Pilot], list[str]], caplog: pytest.LogCaptureFixture, title: str
) -> None:
    _replace_panel(pilot, title, sabotage.inside)
    n_calls = sabotage.n_calls
    assert told(pilot) == []
    whole = set(pilot.rects)
    elsewhere = {"menu.File", "viewport.canvas" if title != VIEWPORT else "capture.camera0"}
    elsewhere |= {"timeline.track"} & whole if title != TIMELINE else set()
    for place in sorted({1 + step * n_calls // PLACES for step in range(PLACES)}):
        sabotage.fails_at = place
        pilot.draw(4)  # a stack that is not balanced makes Dear ImGui raise at the end of the frame
        assert sabotage.n_calls == place
        assert told(pilot) == [f"Error in the panel {title}"] or (title, told(pilot)) == (
            VIEWPORT,
            ["Error in view 1"],
        )
        assert elsewhere <= pilot.rects.keys()
        sabotage.fails_at = None
        _forget(pilot, caplog)
        assert told(pilot) == []
        assert whole - {"viewport.busy"} <= pilot.rects.keys(), "all is as before"


def _ask_to_train_again(pilot: Pilot) -> None:
    pilot.session.question = RetrainQuestion(0, False, "", 29.7, (), None, True, None, None)


@pytest.mark.parametrize(
    ("dialog", "show", "part"),
    [
        ("palette", lambda pilot: pilot.key(key.K, modifiers=(CTRL,)), "the palette"),
        ("preferences", lambda pilot: pilot.key(key.COMMA, modifiers=(CTRL,)), "the preferences"),
        ("dialog", lambda pilot: pilot.studio.frame.dialog.open(), "the dialog for folders"),
        ("questions", _ask_to_train_again, "the question"),
    ],
)
def test_a_dialog_that_fails_is_closed_and_is_not_in_the_way(
    pilot: Pilot,
    sabotage: Sabotage,
    told: Callable[[Pilot], list[str]],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    dialog: str,
    show: Callable[[Pilot], object],
    part: str,
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    owner = getattr(pilot.studio.frame, dialog)
    monkeypatch.setattr(owner, "draw", sabotage.inside(owner.draw))
    show(pilot)
    pilot.draw(3)
    n_calls = sabotage.n_calls
    assert told(pilot) == []
    for place in (n_calls // 3, n_calls // 2, n_calls - 1):
        sabotage.fails_at = place
        pilot.draw(4)
        assert told(pilot) == [f"Error in {part}"]
        frame_index = pilot.session.timeline.frame_index
        pilot.click("timeline.track")
        pilot.key(key.RIGHT)
        assert pilot.session.timeline.frame_index != frame_index
        sabotage.fails_at = pilot.session.question = None
        pilot.key(key.HOME)
        _forget(pilot, caplog)
        show(pilot)
        pilot.draw(3)


def _look_through_a_camera_in_four_views(pilot: Pilot) -> None:
    pilot.session.clip_states[0] = ClipStatus("trained", 1.0, 31.2, n_own=1500)
    pilot.key(key.BRACKETRIGHT)
    pilot.click("viewport.views4")
    pilot.draw(3)


def test_every_mode_is_drawn_in_every_view_however_it_is_compared(
    pilot: Pilot, told: Callable[[Pilot], list[str]]
) -> None:
    _look_through_a_camera_in_four_views(pilot)
    for n_views, compare, mode in itertools.product((2, 4), ("wipe", "side", "blink"), MODES):
        pilot.session.dispatch(ShowViews(n_views))
        for index in range(n_views):
            pilot.session.dispatch(ActivateView(index))
            pilot.session.dispatch(SetCompare(compare))
            pilot.session.dispatch(SetMode(mode))
            pilot.draw()
            assert told(pilot) == [], (n_views, compare, mode, index)


@pytest.mark.parametrize("mode", MODES)
def test_a_mode_that_fails_in_one_view_leaves_the_others(
    pilot: Pilot,
    told: Callable[[Pilot], list[str]],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    mode: str,
) -> None:
    _look_through_a_camera_in_four_views(pilot)
    plain, composed = ViewportScene.compose, []

    def compose(scene: ViewportScene, session: Any, view: SceneView, *rest: Any) -> Any:
        if session.overlays.mode == mode and session.views.current_index == 1:
            raise RuntimeError("broken on purpose")
        composed.append(session.views.current_index)
        return plain(scene, session, view, *rest)

    monkeypatch.setattr(ViewportScene, "compose", compose)
    for look in pilot.session.views.shown:
        look.overlays.mode, look.overlays.compare = mode, "wipe"
    pilot.draw(3)
    assert told(pilot) == ["Error in view 2"]
    assert composed[-3:] == [0, 2, 3]
    pilot.tap(*pilot.rects["viewport.view1"].center)
    assert pilot.session.views.active_index == 1, "the view that fails can still be chosen, and shown otherwise"
    pilot.session.views.shown[1].overlays.mode = next(name for name in MODES if name != mode)
    pilot.draw(2)
    assert composed[-4:] == [0, 1, 2, 3]
    _forget(pilot, caplog)
    assert told(pilot) == []


def test_a_fault_that_comes_and_goes_is_told_again_only_after_its_notice_was_dismissed(
    pilot: Pilot, sabotage: Sabotage, told: Callable[[Pilot], list[str]], caplog: pytest.LogCaptureFixture
) -> None:
    _replace_panel(pilot, TIMELINE, sabotage.inside)
    for _ in range(5):
        sabotage.fails_at = 2
        pilot.draw(2)
        sabotage.fails_at = None
        pilot.draw(2)
    assert told(pilot) == ["Error in the panel Timeline"]
    _forget(pilot, caplog)
    sabotage.fails_at = 2
    pilot.draw(2)
    assert told(pilot) == ["Error in the panel Timeline"]
    _forget(pilot, caplog)  # while it goes on
    assert told(pilot) == []


def test_a_fault_between_two_frames_ends_neither_the_loop_nor_what_it_draws(
    pilot: Pilot, told: Callable[[Pilot], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> bool:
        raise RuntimeError("broken on purpose")

    monkeypatch.setattr(ViewportScene, "has_news", fail)
    pilot.draw(4)
    assert told(pilot) == ["An error occurred between two frames"]
    assert "viewport.canvas" in pilot.rects
