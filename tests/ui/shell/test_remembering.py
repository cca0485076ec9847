"""A window that is closed and opened again looks as it did."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

from app.session.projects.window_memory import read_window_memory
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot

pytestmark = pytest.mark.gl


def open_again(open_pilot: Callable[..., Pilot], path: Path, **options: object) -> Pilot:
    pilot = open_pilot(FakeSession(), memory=read_window_memory(path), **options)
    pilot.rest()
    return pilot


@pytest.mark.slow
def test_view_frame_overlays_scale_and_layout_come_back(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_again(open_pilot, path)
    track = pilot.rects["timeline.track"]
    canvas = pilot.rects["viewport.canvas"]
    pilot.drag((canvas.center[0], canvas.y1 + 1), (canvas.center[0], canvas.y1 - 60), steps=5)
    pilot.drag(pilot.rects["viewport.canvas"].center, (500, 300))
    pilot.key(key._2)
    pilot.key(key.END)
    pilot.key(key.EQUAL, modifiers=(CTRL,))
    pilot.session.overlays.mark_size = 1.7
    pilot.rest()
    assert pilot.rects["timeline.track"].height > track.height + 20
    left, view = dict(pilot.rects), pilot.session.view.world_to_camera()
    pilot.studio.close()

    again = open_again(open_pilot, path)
    np.testing.assert_allclose(again.session.view.world_to_camera(), view)
    assert again.session.timeline.frame_index == again.session.timeline.last_frame
    assert again.session.overlays.show_inherited
    assert again.session.overlays.mark_size == 1.7
    assert again.studio.frame.scale.chosen == 1.25
    for name in ("timeline.track", "viewport.canvas", "training.next"):
        assert np.allclose([*vars(again.rects[name]).values()], [*vars(left[name]).values()], atol=2), name

    again.studio.frame.ui.is_layout_reset_requested = True
    again.rest()
    again.draw(2)
    assert again.rects["timeline.track"].height < left["timeline.track"].height - 20


@pytest.mark.slow
def test_the_camera_looked_through_comes_back(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_again(open_pilot, path)
    pilot.click("capture.camera2")
    pilot.studio.close()
    assert open_again(open_pilot, path).session.view.look_through == 2


@pytest.mark.slow
def test_a_floating_panel_floats_again(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_again(open_pilot, path)
    tab = pilot.rects["training.next"]
    pilot.drag((tab.x0 + 15, tab.y0 - 22), (430, 460), steps=8)  # beside the signs that dock it
    pilot.rest()
    where = pilot.rects["training.next"]
    assert abs(where.x0 - tab.x0) > 100, "the tab was dragged out"
    pilot.studio.close()
    assert open_again(open_pilot, path).rects["training.next"].x0 == pytest.approx(where.x0, abs=2)


@pytest.mark.parametrize(
    "layout", ["", "[Docking][Data]\nDockSpace ID=nonsense", "; another program\n[Window][x]\nPos=9"]
)
def test_a_layout_that_is_none_gives_the_one_to_begin_with(
    open_pilot: Callable[..., Pilot], tmp_path: Path, layout: str
) -> None:
    from ui.shell.layout.remembering import LAYOUT_VERSION

    usual = open_again(open_pilot, tmp_path / "none.json")
    expected = dict(usual.rects)
    usual.studio.close()
    memory = read_window_memory(tmp_path / "window.json")
    memory.layout = LAYOUT_VERSION + layout
    pilot = open_pilot(FakeSession(), memory=memory)
    pilot.rest()
    for name in ("timeline.track", "viewport.canvas", "training.next", "capture.free"):
        assert pilot.rects[name] == expected[name]


@pytest.mark.slow
def test_a_project_opened_later_has_its_own_view(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_again(open_pilot, path)
    pilot.key(key.END)
    pilot.studio.window.dispatch_event("on_file_drop", 5, 5, [str(tmp_path)])
    pilot.rest()
    assert pilot.session.timeline.frame_index == 0
    pilot.key(key.RIGHT)
    pilot.studio.close()
    again = open_again(open_pilot, path)
    assert again.session.timeline.frame_index == again.session.timeline.last_frame
    again.studio.window.dispatch_event("on_file_drop", 5, 5, [str(tmp_path)])
    again.rest()
    assert again.session.timeline.frame_index == 1
