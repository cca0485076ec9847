"""The palette: every action and everything that is open can be found in it, and it is driven by keyboard alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from imgui_bundle import imgui
from pyglet.window import key

from app.playback.timeline import Timeline
from app.project.recents import RecentProject
from app.session.projects.project_commands import OpenProject
from app.session.showing.look_commands import LookThrough, SetFrame
from app.session.training.train_commands import TrainNextClip
from engine.capture.clip import split_clips
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot
from ui.panels.actions.action import Action
from ui.panels.actions.menus import MOST_ITEMS, Menu, menus
from ui.panels.actions.table import ACTIONS
from ui.shell.finding.palette_entries import MOST_SHOWN, entries, found

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def open_palette(pilot: Pilot, typed: str = "") -> list[str]:
    """Ids of what is listed."""
    pilot.key(key.K, modifiers=(CTRL,))
    pilot.draw(2)
    if typed:
        pilot.type(typed)
        pilot.draw(2)
    return [entry.id for entry in pilot.studio.frame.palette.shown]


def test_every_action_is_reached_by_the_palette_and_by_key_or_listed_as_having_none(pilot: Pilot) -> None:
    ui = pilot.studio.frame.ui
    listed = {entry.id: entry for entry in entries(pilot.session, ui)}
    for action in ACTIONS:
        if action.id == "window.palette":  # it is what is open
            continue
        entry = listed[action.id]
        assert entry.keys == ", ".join(action.keys)
        assert found(action.text, list(listed.values()), ())[0].entry.id == action.id
    in_menus = [item.id for menu in menus() for item in _actions(menu)]
    assert sorted(in_menus) == sorted(action.id for action in ACTIONS), "each stands in one menu"
    too_long = {menu.title: len(menu.items) for menu in _all(menus()) if len(menu.items) > MOST_ITEMS}
    assert not too_long, "these do not fit into the smallest window"


def test_menus_begin_with_what_people_look_for_there() -> None:
    tops = {menu.title: [item.id for item in menu.items if isinstance(item, Action)] for menu in menus()}
    assert tops["File"][0] == "window.open"
    assert tops["File"][-1] == "window.quit"
    assert tops["Edit"][:2] == ["mark.undo", "mark.redo"]
    assert tops["Train"][:2] == ["train.next", "train.all"]
    assert list(tops)[-1] == "Help"
    assert {"window.help", "window.palette", "window.documents", "window.log", "window.about"} == set(tops["Help"])
    for menu in _all(menus()):
        lines = [index for index, item in enumerate(menu.items) if item is None]
        assert not {0, len(menu.items) - 1} & set(lines), menu.title
        assert all(after - before > 1 for before, after in pairwise(lines)), menu.title


def test_to_save_as_means_the_project(pilot: Pilot) -> None:
    assert open_palette(pilot, "save as")[0] == "window.save_as"


def test_about_says_where_documents_and_log_are(pilot: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    copied: list[str] = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)  # a window without a screen has no clipboard
    open_palette(pilot, "about clipgstream")
    pilot.key(key.ENTER)
    pilot.draw(4)
    pilot.click("about.log")
    pilot.click("about.documents")
    assert [Path(path).name for path in copied] == ["clipgstream.log", "docs"]
    pilot.click("about.close")
    pilot.rest()
    assert "about.log" not in pilot.rects


def _all(some: list[Menu]) -> list[Menu]:
    return [found for menu in some for found in (menu, *_all([x for x in menu.items if isinstance(x, Menu)]))]


def _actions(menu: Menu) -> list:
    rows = []
    for item in menu.items:
        rows += _actions(item) if isinstance(item, Menu) else [] if item is None else [item]
    return rows


def test_typing_finds_enter_runs_and_the_palette_is_gone(pilot: Pilot) -> None:
    assert open_palette(pilot, "train next")[0] == "train.next"
    pilot.key(key.ENTER)
    pilot.rest()
    assert pilot.sent(TrainNextClip) == [TrainNextClip()]
    assert "palette.typed" not in pilot.rects
    assert open_palette(pilot)[0] == "train.next", "what was used last comes first"


def test_letters_in_the_palette_are_no_shortcuts_and_escape_leaves_everything_as_it_is(pilot: Pilot) -> None:
    open_palette(pilot, "tgm")
    for symbol in (key.T, key.SPACE, key.END):
        pilot.key(symbol)
    pilot.key(key.ESCAPE)
    pilot.rest()
    assert "palette.typed" not in pilot.rects
    assert pilot.session.commands == []
    pilot.key(key.P, modifiers=(CTRL,))
    pilot.draw(2)
    assert "palette.typed" in pilot.rects


def test_arrows_choose_and_go_around(pilot: Pilot) -> None:
    shown = open_palette(pilot, "clip ")
    pilot.key(key.UP)
    pilot.key(key.DOWN)
    pilot.key(key.DOWN)
    assert shown[1] == "clip:1"
    pilot.key(key.ENTER)
    assert pilot.sent(SetFrame) == [SetFrame(10)]


def test_what_cannot_be_run_says_why_and_does_nothing(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    assert open_palette(pilot, "frame the whole")[0] == "view.home"
    assert pilot.studio.frame.palette.shown[0].why_not == "Open a capture or a project first."
    assert "palette.why_not" in pilot.rects
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert pilot.session.commands == []
    assert "palette.typed" in pilot.rects, "it stays open"


def test_projects_cameras_and_clips_are_found_by_name(pilot: Pilot) -> None:
    assert open_palette(pilot, "cam05")[0] == "camera:cam05"
    pilot.key(key.ENTER)
    assert open_palette(pilot, "toy")[0] == "open:/projects/kitchen-toy"
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert pilot.sent(LookThrough) == [LookThrough(5)]
    assert pilot.sent(OpenProject) == [OpenProject(Path("/projects/kitchen-toy"))]


def test_names_are_shown_as_they_are(pilot: Pilot) -> None:
    names = ("a##b", "100 %s%n", "two\nlines", "\u05d0\u05d1\u05d2", "\u202eturned", *pilot.session.rig.names[5:])
    pilot.session.rig = dataclasses.replace(pilot.session.rig, names=names)
    pilot.session.recent.entries.insert(0, RecentProject("/p/x##y", "/c", "x##y %d\n", 1, 2))
    shown = [entry.text for entry in entries(pilot.session, pilot.studio.frame.ui)]
    for text in (
        "Go to camera a##b",
        "Go to camera 100 %s%n",
        "Go to camera two\\nlines",
        "Go to camera \u05d0\u05d1\u05d2",
    ):
        assert text in shown
    assert "Open x##y %d\\n" in shown
    assert open_palette(pilot, "a##b")[0] == "camera:a##b"
    pilot.key(key.ENTER)
    assert pilot.sent(LookThrough) == [LookThrough(0)]
    assert len(pilot.session.notices) == 0


def test_a_thousand_clips_are_offered_and_so_many_listed(pilot: Pilot) -> None:
    session = pilot.session
    session.clips = split_clips(10_000, 10)
    session.timeline = Timeline(session.clips)
    offered = entries(session, pilot.studio.frame.ui)
    assert not [hit for hit in found("go to clip", offered, ()) if hit.entry.is_numbered], "without a number: too many"
    assert len(found("clip 1", offered, ())) == MOST_SHOWN
    assert found("clip 731", offered, ())[0].entry.id == "clip:731"


def test_it_fits_into_the_smallest_window(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(size=(640, 420))
    open_palette(pilot)
    units = pilot.studio.frame.backend.context.io.display_size
    rect = pilot.rects["palette.typed"]
    assert 0 <= rect.x0 < rect.x1 <= units.x
    assert "palette.row0" in pilot.rects
