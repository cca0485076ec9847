"""Nothing is cut off in a small window, at another scale, or after panels were dragged; the timeline stays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyglet
import pytest
from imgui_bundle import imgui
from pyglet.window import key

from app.session.projects.window_memory import WindowMemory
from app.status import ClipStatus
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot
from ui.panels.state import Rect, UiState
from ui.shell.window import screen_scale
from ui.style.ui_scale import MIN_UNITS, UiScale, next_choice, parse_scale

pytestmark = [pytest.mark.gl, pytest.mark.slow]
PADDING = 5.0
"""Rows of lists reach a little into the padding of their window, on purpose."""
SIZES = [(900, 600), (1600, 1000), (880, 560), (640, 420)]


@pytest.fixture
def cut(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Items of which something is missing at the left or right, by name."""
    found: dict[str, str] = {}
    mark = UiState.mark

    def record(self: UiState, name: str) -> None:
        mark(self, name)
        rect, clip = self.rects[name], imgui.internal.get_current_window().clip_rect
        found.pop(name, None)
        if rect.x0 < clip.min.x - PADDING or rect.x1 > clip.max.x + PADDING:
            found[name] = f"{rect} in {clip.min.x:.0f}..{clip.max.x:.0f}"

    monkeypatch.setattr(UiState, "mark", record)
    return found


def open_at(open_pilot: Callable[..., Pilot], tmp_path: Path, size: tuple[int, int], scale: float) -> Pilot:
    session = FakeSession()
    session.clip_states[0] = ClipStatus("trained", 1.0, 27.5, 0, 24_291)
    memory = WindowMemory(tmp_path / "window.json", ui_scale=scale)
    pilot = open_pilot(session, size=(round(size[0] * scale), round(size[1] * scale)), memory=memory)
    pilot.rest()
    return pilot


def assert_complete(pilot: Pilot, cut: dict[str, str]) -> None:
    units = imgui.get_main_viewport().size
    rects = pilot.rects
    track = rects["timeline.track"]
    assert track.height >= 60
    assert track.y1 <= units.y
    for name in ("timeline.clip0", "timeline.clip2"):
        assert rects[name].height >= 30
    flag = rects["timeline.playhead"]
    assert track.x0 <= flag.x0 < flag.x1 <= track.x1
    assert {name: how for name, how in cut.items() if name in rects} == {}
    for name in ("viewport.mark", "viewport.overlays", "capture.camera0", "training.next", "training.psnr"):
        assert name in rects
    canvas = rects["viewport.canvas"]
    assert canvas.width >= 280
    assert canvas.height >= 120


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_nothing_is_cut_off(
    open_pilot: Callable[..., Pilot], cut: dict[str, str], tmp_path: Path, size: tuple[int, int], scale: float
) -> None:
    pilot = open_at(open_pilot, tmp_path, size, scale)
    assert_complete(pilot, cut)


def test_a_window_made_small_shrinks_the_picture_and_not_the_panels(
    open_pilot: Callable[..., Pilot], cut: dict[str, str], tmp_path: Path
) -> None:
    pilot = open_at(open_pilot, tmp_path, (1440, 900), 1.0)
    before = pilot.rects
    track, camera = before["timeline.track"].height, before["capture.camera0"].width
    pilot.studio.window.set_size(900, 600)
    pilot.studio.window.dispatch_event("on_resize", 900, 600)
    pilot.rest()
    assert pilot.rects["timeline.track"].height == pytest.approx(track, abs=2)
    assert pilot.rects["capture.camera0"].width == pytest.approx(camera, abs=2)
    assert_complete(pilot, cut)


def test_the_timeline_cannot_be_dragged_away(
    open_pilot: Callable[..., Pilot], cut: dict[str, str], tmp_path: Path
) -> None:
    pilot = open_at(open_pilot, tmp_path, (900, 600), 1.0)
    canvas = pilot.rects["viewport.canvas"]
    pilot.drag((canvas.center[0], canvas.y1 + 1), (canvas.center[0], 590), steps=6)
    pilot.rest()
    assert pilot.rects["viewport.canvas"].y1 > canvas.y1 + 10, "the border was taken hold of"
    assert_complete(pilot, cut)


def test_letters_at_twice_the_scale_are_drawn_and_not_stretched(
    open_pilot: Callable[..., Pilot], tmp_path: Path
) -> None:
    small = open_at(open_pilot, tmp_path, (900, 600), 1.0)
    rect = small.rects["training.next"]
    once = _cut_out(small.picture(), rect, 1)
    small.studio.close()
    large = open_at(open_pilot, tmp_path, (900, 600), 2.0)
    assert large.rects["training.next"] == rect, "in units everything stays where it is"
    twice = _cut_out(large.picture(), rect, 2)
    stretched = np.kron(once, np.ones((2, 2, 1)))
    assert twice.shape == stretched.shape
    # as large, but sharper: more change from pixel to pixel than in pixels drawn twice
    assert abs(twice.mean() - stretched.mean()) < 6
    assert np.abs(np.diff(twice, axis=1)).max() > 60
    assert np.abs(twice - stretched).max() > 60


def _cut_out(picture: np.ndarray, rect: Rect, scale: int) -> np.ndarray:
    x0, y0, x1, y1 = (round(value) * scale for value in (rect.x0, rect.y0, rect.x1, rect.y1))
    return picture[y0:y1, x0:x1].astype(np.float64)


def test_the_scale_changes_by_key_and_menu(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    pilot = open_at(open_pilot, tmp_path, (1800, 1200), 1.0)
    backend, scale = pilot.studio.frame.backend, pilot.studio.frame.scale
    pilot.key(key.EQUAL, modifiers=(CTRL,))
    assert (scale.chosen, backend.pixels_per_unit) == (1.25, 1.25)
    pilot.key(key.MINUS, modifiers=(CTRL,))
    pilot.key(key.MINUS, modifiers=(CTRL,))
    assert backend.pixels_per_unit == 0.75
    pilot.tap(*pilot.rects["menu.View"].center)
    pilot.tap(*pilot.rects["menu.scale"].center)
    pilot.tap(*pilot.rects["menu.200 %"].center)
    assert backend.pixels_per_unit == 2.0
    pilot.click("timeline.forward")
    assert pilot.session.timeline.frame_index == 1, "the pointer is where it is seen"
    pilot.key(key._0, modifiers=(CTRL,))
    assert (scale.chosen, backend.pixels_per_unit) == (None, 1.0)


def test_scales_as_typed_and_as_they_fit() -> None:
    assert [parse_scale(text) for text in ("auto", "150%", "1.5", " 75 % ")] == [None, 1.5, 1.5, 0.75]
    for nonsense in ("", "big", "0", "nan", "-1", "300%", "150"):
        with pytest.raises(Exception, match="is not a scale"):
            parse_scale(nonsense)
    assert next_choice(1.0, 1) == 1.25
    assert next_choice(1.1, -1) == 1.0
    assert next_choice(2.5, 1) == 2.5
    assert UiScale(of_screen=2.0).fitting(1800, 1200) == 2.0
    assert UiScale(1.5, of_screen=2.0).wanted == 1.5
    assert UiScale(2.0).fitting(MIN_UNITS[0], 4000) == 1.0, "shown smaller rather than cut off"
    assert UiScale(of_screen=float("nan")).wanted == 1.0


@pytest.mark.parametrize(("dpi", "scale"), [(192, 2.0), (96, 1.0), (144, 1.5)])
def test_the_screen_s_own_scale_is_taken(monkeypatch: pytest.MonkeyPatch, dpi: int, scale: float) -> None:
    class Screen:
        def get_dpi(self) -> int:
            return dpi

    class Display:
        def get_default_screen(self) -> Screen:
            return Screen()

    monkeypatch.setattr("pyglet.display.get_display", Display)
    monkeypatch.setattr(pyglet.options, "headless", False)
    monkeypatch.setattr("sys.platform", "linux")
    assert screen_scale() == scale
    assert UiScale(of_screen=screen_scale()).wanted == scale
