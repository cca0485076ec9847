"""Modes and comparisons in the window: keys, boxes, bars, blinking and the held key. The session is a stand-in."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

import ui.panels.picture.comparison as comparison
from app.playback.modes.view_modes import CONTENTS, MODES
from app.session.showing.look_commands import (
    CompareProject,
    LookThrough,
    SetCompare,
    SetCompareWith,
    SetContent,
    SetMode,
    ShowHeat,
)
from app.status import (
    BLINK_HZ,
    CAPTURED,
    PROJECT,
    ClipStatus,
    OtherStatus,
    Overlays,
    VersionStatus,
    version_name,
    version_number,
)
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import SHIFT, Pilot
from ui.panels.actions.table import ACTIONS
from ui.panels.picture.color_bar import bar_number
from ui.panels.picture.comparison import covered_share, missing_words
from ui.panels.picture.toolbar.row_fit import RowFit, fit_row
from ui.panels.pieces.widgets import box_words
from ui.panels.state import UiState

DIGITS = (key._1, key._2, key._3, key._4, key._5, key._6, key._7, key._8, key._9)


@pytest.fixture
def trained(open_pilot: Callable[..., Pilot]) -> Pilot:
    """A window on a clip that is trained."""
    session = FakeSession()
    session.clip_states[0] = ClipStatus(state="trained")
    return open_pilot(session)


@pytest.mark.slow
def test_every_mode_has_a_key_of_its_own_and_leaves_the_others_theirs(trained: Pilot) -> None:
    for digit in DIGITS[: len(MODES)]:
        trained.key(digit, modifiers=(SHIFT,))
    assert [command.mode for command in trained.sent(SetMode)] == list(MODES)
    assert trained.session.overlays.show_frusta, "1 alone shows and hides cameras"


def test_every_mode_and_part_can_be_reached_from_the_table_of_actions() -> None:
    ids = {action.id for action in ACTIONS}
    assert {f"mode.{name}" for name in MODES} | {f"content.{name}" for name in CONTENTS} <= ids
    assert {f"compare.with_{name}" for name in (CAPTURED, *MODES)} <= ids


@pytest.mark.slow
def test_the_box_of_modes_sets_mode_and_part(trained: Pilot) -> None:
    for name, kind in (("viewport.mode.normals", SetMode), ("viewport.content.f_s", SetContent)):
        trained.click("viewport.mode")
        trained.draw(3)
        trained.click(name)
        assert len(trained.sent(kind)) == 1
    trained.draw(2)
    assert trained.studio.frame.viewport.hud.text.label.endswith("f_s only, Normals")


@pytest.mark.slow
@pytest.mark.parametrize("size", [(900, 600), (1280, 800), (1920, 1000)])
@pytest.mark.parametrize("n_views", [1, 4])
def test_the_toolbar_fits(size: tuple[int, int], n_views: int, open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession()
    session.views.show(n_views)
    pilot = open_pilot(session, size=size)
    canvas = pilot.rects["viewport.view0" if n_views == 1 else "viewport.view1"]
    names = ["viewport.camera", "viewport.mode", "viewport.compare", "viewport.heat", "viewport.overlays"]
    names += ["viewport.mark", "viewport.more", "viewport.views1", "viewport.views2", "viewport.views4"]
    boxes = [pilot.rects[name] for name in names if name in pilot.rects]
    assert boxes[-1].x1 <= canvas.x1 + 1
    assert {"viewport.camera", "viewport.mode", "viewport.overlays"} <= pilot.rects.keys()
    hidden = [name for name in names if name not in pilot.rects and name != "viewport.more"]
    assert bool(hidden) == ("viewport.more" in pilot.rects)
    if hidden:
        pilot.click("viewport.more")
        pilot.draw(3)
        assert set(names) <= pilot.rects.keys(), "the menu at the end has the rest"
    for left, right in itertools.pairwise(boxes):
        assert left.x1 <= right.x0
    assert all(box.width >= 20 for box in boxes)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["R", "clips"])
@pytest.mark.parametrize(("size", "scale"), [((1600, 1000), 1.0), ((1600, 1000), 1.5), ((1600, 1000), 2.0)])
def test_words_of_the_toolbar_are_whole_or_in_the_menu(
    kind: str, size: tuple[int, int], scale: float, open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    cut: list[str] = []
    plain = box_words

    def watched(words: str, width: float) -> str:
        shown = plain(words, width)
        cut.extend([words] if shown != words else [])
        return shown

    for module in ("toolbar", "compare_box"):
        monkeypatch.setattr(f"ui.panels.picture.toolbar.{module}.box_words", watched)
    pilot = open_pilot(FakeSession(), size=size)
    pilot.studio.frame.ui.scale.chosen = scale
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(ShowHeat(kind))
    pilot.session.dispatch(SetCompare("side"))
    pilot.draw(6)
    cut.clear()
    pilot.draw(2)
    assert cut == []


def test_a_row_hides_what_is_missed_least_first() -> None:
    styles = [{"a": 100.0, "b": 100.0, "c": 50.0}, {"a": 60.0, "b": 60.0, "c": 50.0}]
    fit = partial(fit_row, styles, gap=10.0, menu=20.0, can_hide=("c", "b"))
    assert fit(270.0) == RowFit(0, styles[0])
    assert fit(190.0) == RowFit(1, styles[1])
    assert fit(189.0) == RowFit(1, {"a": 60.0, "b": 60.0}, ("c",))
    assert fit(159.0) == RowFit(1, {"a": 60.0}, ("b", "c"))
    assert fit(10.0) == RowFit(1, {"a": 60.0}, ("b", "c"))


@pytest.mark.slow
def test_a_bar_says_what_colours_mean_and_the_value_under_the_pointer(
    trained: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    values: list[float | None] = []
    monkeypatch.setattr("ui.panels.picture.hud.draw_color_bar", lambda *arguments: values.append(arguments[-1]))
    assert "viewport.color_bar" not in trained.rects
    trained.key(DIGITS[1], modifiers=(SHIFT,))
    pane = trained.rects["viewport.rendered"]
    for share in (0.25, 0.75):
        trained.move(pane.x0 + share * pane.width, pane.y0 + 0.4 * pane.height)
        trained.draw(2)
        assert values[-1] == pytest.approx(share, abs=0.01)
    trained.move(*trained.rects["viewport.mode"].center)
    trained.draw(2)
    assert values[-1] is None
    assert trained.rects["viewport.color_bar"].x1 <= pane.x1


@pytest.mark.slow
def test_comparing_with_a_mode_needs_no_camera(trained: Pilot) -> None:
    session = trained.session
    session.dispatch(SetCompareWith("depth"))
    before = trained.picture()
    session.dispatch(SetCompare("wipe"))
    trained.draw(3)
    assert trained.sent(LookThrough) == []
    pane = trained.rects["viewport.rendered"]
    x, y = int(pane.x0 + 0.25 * pane.width), int(pane.center[1])
    shown, right = trained.picture(), int(pane.x0 + 0.75 * pane.width)
    assert shown[y, x, 0] == shown[y, x, 2] == 0, "the other picture is green"
    np.testing.assert_array_equal(shown[y, right], before[y, right])
    session.dispatch(SetCompare("side"))
    trained.draw(3)
    assert trained.rects["viewport.rendered"].width < 0.55 * pane.width


@pytest.mark.slow
def test_a_captured_picture_still_takes_the_nearest_camera(trained: Pilot) -> None:
    trained.session.dispatch(SetCompareWith(CAPTURED))
    trained.key(key.G)
    assert len(trained.sent(LookThrough)) == 1


@pytest.mark.slow
def test_while_b_is_held_the_other_picture_is_seen_alone(trained: Pilot) -> None:
    trained.session.dispatch(SetCompareWith("depth"))
    trained.draw(2)
    pane = trained.rects["viewport.rendered"]
    at = int(pane.center[1]), int(pane.x0 + 0.75 * pane.width)
    assert trained.picture()[at][0] > 0
    trained.studio.window.dispatch_event("on_key_press", key.B, 0)
    trained.draw(3)
    assert trained.picture()[at][0] == 0
    trained.studio.window.dispatch_event("on_key_release", key.B, 0)
    trained.draw(3)
    assert trained.picture()[at][0] > 0


class Compared:
    """As much of a session as a comparison asks for."""

    def __init__(self, **overlays: object) -> None:
        self.overlays, self.view = Overlays(**overlays), None  # type: ignore[arg-type]


def test_blinking_shows_each_picture_for_as_long_and_never_faster_than_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    for hz in BLINK_HZ:
        session, seen = Compared(compare="blink", blink_hz=hz), []
        for step in range(1000):
            ui = UiState()
            now_s = step / 100.0
            monkeypatch.setattr(comparison.time, "perf_counter", lambda now_s=now_s: now_s)
            seen.append(covered_share(session, ui, is_held=False))  # type: ignore[arg-type]
            assert ui.redraw_in_s is not None
            assert 0.0 < ui.redraw_in_s <= 0.5 / hz + 1e-9
        changes = int((np.diff(seen) != 0).sum())
        assert set(seen) == {0.0, 1.0}
        assert changes == pytest.approx(20 * hz, abs=1), "two changes a cycle, in ten seconds"
    assert BLINK_HZ[1] <= 3.0
    assert Overlays().blink_hz <= 3.0


def test_a_held_key_covers_everything_and_a_wipe_its_share() -> None:
    session, ui = Compared(compare="wipe", wipe_position=0.3), UiState()
    assert covered_share(session, ui, is_held=False) == 0.3  # type: ignore[arg-type]
    assert covered_share(session, ui, is_held=True) == 1.0  # type: ignore[arg-type]
    assert ui.redraw_in_s is None


def test_another_project_is_chosen_where_versions_are(
    trained: Pilot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    scene = tmp_path / "dance.4dgs"
    scene.touch()
    dialog = trained.studio.frame.dialog
    dialog._start, dialog._text = tmp_path, str(scene)
    for place in ("recent.0", "choose"):
        trained.click("viewport.compare")
        trained.draw(3)
        trained.click(f"viewport.other.{place}")
        trained.draw(3)
    trained.click("open.accept")
    recent = trained.session.recent.entries[0].folder
    assert trained.sent(CompareProject) == [CompareProject(recent), CompareProject(scene)]


def test_a_shorter_project_says_so_and_holds_nothing_up(trained: Pilot) -> None:
    session, pane = trained.session, trained.studio.frame.viewport
    session.dispatch(SetCompare("wipe"))
    session.dispatch(SetCompareWith(PROJECT))
    trained.draw(3)
    assert comparison.shown_compare(session) == "off", "no other project is chosen"
    session.other_project = OtherStatus("dance", Path("/projects/dance"), 2)
    session.timeline.seek(3)
    trained.draw(3)
    assert comparison.shown_compare(session) == "wipe"
    assert comparison.frame_to_compare(session) == 1
    assert pane.shows_playhead(session), "playing every frame waits for no frame that does not exist"
    missing = OtherStatus("dance", Path("/projects/dance"), 2, missing="dance cannot be shown")
    assert missing_words(session.overlays, [], missing) == "dance cannot be shown"
    assert missing_words(session.overlays, [], session.other_project) == "dance is being drawn"


def test_an_earlier_version_that_is_not_there_says_so() -> None:
    overlays, versions = Overlays(compare_with=version_name(3)), [VersionStatus(2)]
    words = [
        missing_words(overlays, versions),
        missing_words(overlays, [VersionStatus(3)]),
        missing_words(Overlays(), versions),
    ]
    assert len(set(words)) == 3
    for other in (CAPTURED, "depth", "version", "version x", "version -1", "version ²"):
        assert version_number(other) is None


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (0.0, 0.0, 5.8, "0"),
        (5.8, 0.0, 5.8, "5.8"),
        (1.234567, 0.0, 5.8, "1.23"),
        (-0.00001, -0.5, 0.5, "0"),
        (100.0, 0.0, 100.0, "100"),
        (37.4, 0.0, 1000.0, "37"),
        (0.00012, 0.0, 0.0005, "0.00012"),
        (0.4512, 0.0, 25.5, "0.45"),
        (0.0452, 0.0, 25.5, "0.045"),
        (-0.22, -25.5, 25.5, "-0.22"),
        (3.21, 0.0, 25.5, "3.2"),
    ],
)
def test_numbers_of_a_bar_are_short_and_tell_steps_apart(value: float, low: float, high: float, text: str) -> None:
    assert bar_number(value, low, high) == text
