"""The preferences in the window: pages, keys of one's own, themes that are seen at once, what is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

from app.project.projects_folder import VARIABLE
from app.session.projects.preferences import PreferencesFile
from app.session.projects.window_memory import WindowMemory
from app.session.showing.look_commands import SetFrameMemory, TogglePlay
from app.session.training.train_commands import TrainNextClip
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot
from ui.panels.actions.table import ACTIONS
from ui.shell.preferences import projects_words
from ui.style import theme
from ui.style.palette import DARK

pytestmark = [pytest.mark.gl, pytest.mark.slow]


@pytest.fixture(autouse=True)
def dark_again() -> object:
    """Colours belong to the process; other tests expect the usual ones."""
    yield
    theme.take(DARK)


def open_keys(pilot: Pilot, typed: str) -> None:
    pilot.key(key.COMMA, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.click("preferences.Keys")
    pilot.draw(2)
    pilot.click("keys.filter")
    pilot.type(typed)
    pilot.draw(2)


def test_a_new_key_works_at_once_and_after_a_restart(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "preferences.json"
    pilot = open_pilot(preferences=PreferencesFile(path))
    open_keys(pilot, "play or pause")
    pilot.click("keys.time.play")
    pilot.draw(2)
    pilot.key(key.Y, modifiers=(key.LALT,))
    pilot.draw(2)
    pilot.key(key.ESCAPE)
    pilot.rest()
    assert "preferences.Keys" not in pilot.rects
    pilot.key(key.SPACE)
    assert pilot.sent(TogglePlay) == []
    pilot.key(key.Y, modifiers=(key.LALT,))
    assert len(pilot.sent(TogglePlay)) == 1
    pilot.studio.close()
    again = open_pilot(preferences=PreferencesFile(path))
    again.key(key.Y, modifiers=(key.LALT,))
    assert len(again.sent(TogglePlay)) == 1


def test_a_key_that_another_action_has_is_asked_for(pilot: Pilot) -> None:
    keys = pilot.studio.frame.ui.keys
    open_keys(pilot, "play or pause")
    for answer in ("keys.cancel", "keys.take"):
        pilot.click("keys.time.play")
        pilot.draw(2)
        pilot.key(key.T)
        pilot.draw(2)
        assert pilot.sent(TrainNextClip) == []
        pilot.click(answer)
        pilot.draw(2)
        assert bool(keys.chosen) == (answer == "keys.take")
    assert keys.chosen == {"time.play": ["T"], "train.next": []}
    pilot.click("keys.time.play.reset")
    pilot.draw(2)
    assert keys.chosen == {"train.next": []}
    pilot.click("keys.reset_all")
    pilot.draw(2)
    assert keys.chosen == {}
    pilot.click("keys.time.play.clear")
    assert keys.chosen == {"time.play": []}


def test_escape_ends_the_question_for_a_key_first_and_then_the_preferences(pilot: Pilot) -> None:
    open_keys(pilot, "play or pause")
    pilot.click("keys.time.play")
    pilot.draw(2)
    assert "keys.cancel" in pilot.rects
    pilot.key(key.ESCAPE)
    pilot.draw(2)
    assert "keys.cancel" not in pilot.rects
    assert "keys.filter" in pilot.rects
    pilot.key(key.ESCAPE)
    pilot.rest()
    assert "keys.filter" not in pilot.rects
    assert pilot.studio.frame.ui.keys.chosen == {}


def test_the_theme_changes_while_the_window_is_open_and_pictures_stay_on_dark(
    open_pilot: Callable[..., Pilot], tmp_path: Path
) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    session = FakeSession()
    session.overlays.show_points = session.overlays.show_frusta = False
    pilot = open_pilot(session, preferences=file)
    dark = pilot.picture()
    pilot.key(key.COMMA, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.click("preferences.theme.light")
    pilot.key(key.ESCAPE)
    pilot.rest()
    light = pilot.picture()
    canvas = pilot.rects["viewport.canvas"]
    inside = np.s_[int(canvas.y0) + 60 : int(canvas.y1) - 120, int(canvas.x0) + 60 : int(canvas.x1) - 60]
    np.testing.assert_array_equal(light[inside], dark[inside])
    for y in (4, 796):  # menu bar and status bar
        assert dark[y].mean() < 60
        assert light[y].mean() > 200
    track = pilot.rects["timeline.track"]
    assert light[int(track.y1) - 4, int(track.x0) + 300].mean() > 200
    pilot.studio.close()
    assert PreferencesFile(file.path).values.theme == "light"


def test_the_desktop_s_theme_is_asked_for_what_it_says() -> None:
    from ui.style.system_theme import says_light

    assert says_light("linux", "'prefer-light'\n", is_answered=True)
    assert not says_light("linux", "'prefer-dark'\n", is_answered=True)
    assert not says_light("linux", "", is_answered=False)
    assert says_light("darwin", "", is_answered=False)
    assert not says_light("darwin", "Dark\n", is_answered=True)
    assert says_light("win32", "  AppsUseLightTheme    REG_DWORD    0x1\r\n", is_answered=True)
    assert not says_light("win32", "  AppsUseLightTheme    REG_DWORD    0x0\r\n", is_answered=True)


def test_scale_and_memory_are_chosen(pilot: Pilot) -> None:
    pilot.key(key.COMMA, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.click("preferences.scale")
    pilot.draw(2)
    pilot.click("preferences.scale.75 %")
    pilot.draw(3)
    assert pilot.studio.frame.scale.chosen == 0.75
    pilot.click("preferences.Memory")
    pilot.draw(2)
    pilot.click("preferences.cache_usual")
    pilot.draw(2)
    preferences = pilot.studio.frame.ui.preferences
    assert preferences.cache_mb == 384
    pilot.tap(pilot.rects["preferences.cache"].x0 + 30, pilot.rects["preferences.cache"].center[1])
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type("3")
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert preferences.cache_mb == 128, "held inside what makes sense"
    assert pilot.sent(SetFrameMemory)[-1] == SetFrameMemory(128)


def test_a_configuration_that_cannot_be_written_is_one_notice(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    (tmp_path / "config").write_text("a file where the folder should be")
    file = PreferencesFile(tmp_path / "config" / "preferences.json")
    pilot = open_pilot(preferences=file, memory=WindowMemory(tmp_path / "config" / "window.json"))
    for name in ("light", "dark"):
        file.values.theme = name
        pilot.studio.frame.remembering.save(pilot.session)
    pilot.draw(3)
    (notice,) = pilot.session.notices
    assert (notice.kind, notice.title) == ("warn", "Preferences cannot be saved")
    assert str(tmp_path / "config") in notice.detail
    pilot.key(key.SPACE)
    assert pilot.session.timeline.is_playing


def test_unknown_actions_in_the_file_are_dropped_and_the_rest_counts(
    open_pilot: Callable[..., Pilot], tmp_path: Path
) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.values.keys.update({"no.such.action": ["A"], "time.play": ["Hyper+Q"], "train.next": ["Y"]})
    pilot = open_pilot(preferences=file)
    pilot.key(key.Y)
    assert len(pilot.sent(TrainNextClip)) == 1
    pilot.key(key.SPACE)
    assert len(pilot.sent(TogglePlay)) == 1


@pytest.mark.parametrize(("size", "scale"), [((900, 600), 1.0), ((900, 600), 2.0), ((640, 420), 1.0)])
def test_every_page_fits(open_pilot: Callable[..., Pilot], tmp_path: Path, size: tuple[int, int], scale: float) -> None:
    memory = WindowMemory(tmp_path / "window.json", ui_scale=scale)
    pilot = open_pilot(size=(round(size[0] * scale), round(size[1] * scale)), memory=memory)
    pilot.key(key.COMMA, modifiers=(CTRL,))
    pilot.draw(3)
    units = pilot.studio.frame.backend.context.io.display_size
    for title in pilot.studio.frame.preferences.titles:
        pilot.click(f"preferences.{title}")
        pilot.draw(3)
        for name, rect in pilot.rects.items():
            if name.startswith(("preferences.", "keys.filter", "keys.reset_all")):
                assert 0 <= rect.x0 <= rect.x1 <= units.x, name


def test_the_help_sheet_lists_every_key_and_nothing_without_one(pilot: Pilot) -> None:
    from ui.panels.actions.action import WINDOW
    from ui.shell.finding.help_sheet import _rows

    ui = pilot.studio.frame.ui
    groups = dict.fromkeys(action.group for action in ACTIONS)
    rows = [row for group in groups for row in _rows(group, ui)]
    assert len(rows) == sum(action.is_in_help and bool(action.keys) for action in ACTIONS)
    assert all(label for label, _ in rows)
    ui.keys.clear(next(action for action in ACTIONS if action.id == "window.help"))
    assert "Keys and mouse" not in [text for _, text in _rows(WINDOW, ui)]


def test_the_help_sheet_is_searched_by_key_and_by_words(pilot: Pilot) -> None:
    pilot.key(key.F1)
    pilot.draw(3)  # the cursor stands in the search
    pilot.type("bookmark NEXT")
    pilot.draw(2)
    sheet = pilot.studio.frame.help_sheet
    rows = [("B", "Next bookmark"), ("Shift+B", "Bookmark this view"), ("N", "Next clip")]
    assert sheet._found(rows) == rows[:1]
    pilot.key(key.F1)
    pilot.draw(3)
    assert not pilot.studio.frame.ui.is_help_open
    assert sheet._found(rows) == rows


def test_the_folder_of_projects_is_named_again_only_where_the_box_does_not_show_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert projects_words("") == projects_words("/films")
    assert str(Path("films").absolute()) in projects_words("films")
    monkeypatch.setenv(VARIABLE, "/named")
    assert "/named" in projects_words("/films")
    assert VARIABLE in projects_words("/films")
