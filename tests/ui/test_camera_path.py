"""Camera paths in the window: made in the panel, moved on the timeline and in the picture, by pointer and by keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pyglet.window import key

from app.session.editing.edit_commands import Undo
from app.session.paths import path_commands as p
from app.session.showing.look_commands import SetFrame
from engine.camera.camera_path import CameraKey, CameraPath
from engine.camera.projection import to_camera, to_pixels
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.state import PATHS

pytestmark = [pytest.mark.gl, pytest.mark.slow]

ALT = key.LALT


@pytest.fixture
def pilot(open_pilot: Callable[..., Pilot]) -> Pilot:
    """A window with two keys of a path in sight and the panel in front."""
    session = FakeSession()
    session.timeline.seek(5)
    session.view.orbit(120.0, 20.0)
    session.dispatch(p.SetCameraKey())
    session.timeline.seek(20)
    session.view.orbit(-260.0, 10.0)
    session.dispatch(p.SetCameraKey())
    session.dispatch(p.ChooseCameraKey(None))
    session.view.orbit(130.0, 60.0)
    session.view.dolly(1.9)
    session.overlays.show_frusta = False
    pilot = open_pilot(session)
    pilot.studio.frame.ui.wanted_panel = PATHS
    pilot.draw(4)
    session.commands.clear()
    return pilot


def keys(pilot: Pilot) -> tuple[CameraKey, ...]:
    path = pilot.session.paths.path
    assert path is not None
    return path.keys


def on_screen(pilot: Pilot, center: np.ndarray) -> tuple[float, float]:
    """Where a place of the scene is seen in the window."""
    rect, view = pilot.rects["viewport.rendered"], pilot.session.view
    seen = to_camera(center[None], view.world_to_camera())
    x, y = to_pixels(seen, view.K(round(rect.width), round(rect.height)))[0]
    assert seen[0, 2] > 0
    return rect.x0 + float(x), rect.y0 + float(y)


def double_click(pilot: Pilot, x: float, y: float) -> None:
    pilot.move(x, y)
    for _ in range(2):
        pilot.press()
        pilot.release()


def test_the_panel_begins_a_path_and_adds_keys(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot()
    pilot.studio.frame.ui.wanted_panel = PATHS
    pilot.draw(3)
    assert "timeline.key0" not in pilot.rects
    pilot.click("paths.key")
    pilot.session.timeline.seek(12)
    pilot.click("paths.key")
    assert [one.frame for one in keys(pilot)] == [0.0, 12.0]
    pilot.draw(2)
    assert {"timeline.key0", "timeline.key1", "paths.key0", "paths.key1"} <= {*pilot.rects}
    for name, kind in (
        ("paths.turntable", p.MakeTurntable),
        ("paths.fly_through", p.MakeFlyThrough),
        ("paths.new", p.NewCameraPath),
        ("paths.along", p.LookAlongPath),
        ("paths.loop", p.CloseCameraPath),
    ):
        pilot.click(name)
        assert len(pilot.sent(kind)) == 1, name
    pilot.click("paths.row0")
    assert pilot.session.paths.chosen == 0
    pilot.click("paths.key1")
    assert pilot.session.paths.chosen_key == 1
    for name, kind in (
        ("paths.aim", p.AimCameraKey),
        ("paths.go", p.ChooseCameraKey),
        ("paths.remove", p.DeleteCameraKey),
    ):
        pilot.click(name)
        assert pilot.sent(kind), name
    pilot.click("paths.delete")
    assert len(pilot.session.paths.paths) == 3
    pilot.click("paths.undo")
    assert len(pilot.sent(Undo)) == 1
    assert len(pilot.session.notices) == 0


def test_names_are_shown_as_they_are_and_changed_by_enter(pilot: Pilot) -> None:
    session = pilot.session
    session.dispatch(p.RenameCameraPath("100 %s %n ##x\n</b>"))
    session.dispatch(p.NewCameraPath("100 %s %n ##x"))
    pilot.draw(3)
    pilot.click("paths.name")
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type("%d ##flight")
    assert pilot.sent(p.RenameCameraPath)[1:] == [], "not before Enter"
    pilot.key(key.ENTER)
    assert pilot.sent(p.RenameCameraPath)[-1].name == "%d ##flight"
    assert len(session.notices) == 0
    n_sent = len(session.commands)
    pilot.click("paths.name")
    pilot.type("no")
    pilot.key(key.ESCAPE)
    assert session.commands[n_sent:] == []


def test_keys_are_dragged_in_time_on_the_timeline(pilot: Pilot) -> None:
    start = pilot.rects["timeline.key1"].center
    stop = pilot.rects["timeline.key0"].center
    pilot.drag(start, ((start[0] + stop[0]) / 2, start[1]))
    assert keys(pilot)[0].frame == 5.0
    assert keys(pilot)[1].frame in (12.0, 13.0)
    assert len({command.gesture for command in pilot.sent(p.TimeCameraKey)}) == 1, "a drag is one step back"
    assert pilot.sent(SetFrame) == [], "the playhead stays"
    assert pilot.session.paths.chosen_key == 1
    pilot.drag(pilot.rects["timeline.key1"].center, (stop[0] - 60, stop[1]))
    assert [one.frame for one in keys(pilot)] == [5.0, 6.0], "held by its neighbour"
    first, second = ({command.gesture for command in pilot.sent(p.TimeCameraKey)[i:][:1]} for i in (0, -1))
    assert first != second


def test_a_double_click_on_the_timeline_goes_to_the_key(pilot: Pilot) -> None:
    double_click(pilot, *pilot.rects["timeline.key0"].center)
    assert pilot.sent(p.ChooseCameraKey) == [p.ChooseCameraKey(0), p.ChooseCameraKey(0, is_going=True)]
    track = pilot.rects["timeline.track"]
    pilot.move(track.center[0], pilot.rects["timeline.key0"].center[1])
    pilot.press()
    pilot.release()
    assert len(pilot.sent(SetFrame)) == 1, "beside the keys the lane scrubs as the others do"


def test_a_key_in_the_picture_follows_the_pointer(pilot: Pilot) -> None:
    before, eye = keys(pilot)[0].center, pilot.session.view.eye.copy()
    start = on_screen(pilot, before)
    stop = (start[0] + 70, start[1] - 40)
    pilot.drag(start, stop)
    after = keys(pilot)[0].center
    assert np.allclose(on_screen(pilot, after), stop, atol=1.5)
    forward = pilot.session.view.forward
    assert (after - before) @ forward == pytest.approx(0.0, abs=1e-9), "not in the plane of the screen"
    assert np.allclose(pilot.session.view.eye, eye), "the view was dragged, too"
    assert len({command.gesture for command in pilot.sent(p.PlaceCameraKey)}) == 1
    assert pilot.session.paths.chosen_key == 0


def test_with_ctrl_a_key_goes_along_the_view(pilot: Pilot) -> None:
    before = keys(pilot)[0].center
    start = on_screen(pilot, before)
    pilot._send("on_key_press", CTRL, 0)
    pilot.drag(start, (start[0] + 30, start[1] - 50))
    pilot._send("on_key_release", CTRL, 0)
    moved = keys(pilot)[0].center - before
    forward = pilot.session.view.forward
    assert moved @ forward > 0.1, "upwards is farther away"
    assert np.allclose(moved, (moved @ forward) * forward)


def test_a_click_chooses_and_a_double_click_goes_there(pilot: Pilot) -> None:
    x, y = on_screen(pilot, keys(pilot)[1].center)
    pilot.move(x, y)
    pilot.press()
    pilot.release()
    assert pilot.session.paths.chosen_key == 1
    assert pilot.sent(p.PlaceCameraKey) == []
    pivot = pilot.session.view.pivot.copy()
    pilot.draw(60)  # not the first half of a double click
    double_click(pilot, x, y)
    assert pilot.sent(p.ChooseCameraKey)[-1] == p.ChooseCameraKey(1, is_going=True)
    assert np.allclose(pilot.session.view.pivot, pivot), "what lies behind the key was focused"


def test_everything_is_done_by_keys(pilot: Pilot) -> None:
    session = pilot.session
    pilot.key(key.RIGHT, modifiers=(ALT,))
    assert session.commands[-1] == p.ChooseCameraKey(1, is_going=True), "the playhead stands there"
    session.timeline.seek(12)
    pilot.key(key.LEFT, modifiers=(ALT,))
    assert session.commands[-1] == p.ChooseCameraKey(0, is_going=True)
    pilot.key(key.RIGHT, modifiers=(ALT, SHIFT))
    pilot.key(key.RIGHT, modifiers=(ALT, SHIFT))
    assert keys(pilot)[0].frame == 7.0
    first, second = pilot.sent(p.TimeCameraKey)
    assert first.gesture == second.gesture > 0, "presses in a row are one step back"
    before = keys(pilot)[0].center
    for symbol, row, sign in ((key.LEFT, 0, -1), (key.DOWN, 1, 1)):
        pilot.key(symbol, modifiers=(CTRL,))
        moved = keys(pilot)[0].center - before
        assert sign * (moved @ session.view.rotation[row]) > 0
        before = keys(pilot)[0].center
    pilot.key(key.PAGEUP)
    assert (keys(pilot)[0].center - before) @ session.view.forward > 0
    pilot.key(key.C, modifiers=(SHIFT,))
    assert session.commands[-1] == p.AimCameraKey(0)
    pilot.key(key.C)
    assert session.commands[-1] == p.SetCameraKey()
    assert [one.frame for one in keys(pilot)] == [7.0, 12.0, 20.0]
    pilot.key(key.DELETE)
    assert [one.frame for one in keys(pilot)] == [7.0, 20.0]
    pilot.key(key.P)
    assert session.paths.is_along
    pilot.key(key.Z, modifiers=(CTRL,))
    assert len(pilot.sent(Undo)) == 1


def test_the_path_is_drawn_unless_it_is_hidden_or_looked_along(pilot: Pilot) -> None:
    rect = pilot.rects["viewport.rendered"]
    pilot.move(rect.x0 + 5, rect.y1 - 5)

    def picture() -> np.ndarray:
        pilot.rest()
        whole = pilot.picture()
        return whole[round(rect.y0) + 60 : round(rect.y1) - 60, round(rect.x0) : round(rect.x1)].astype(int)

    shown = picture()
    pilot.key(key.P, modifiers=(SHIFT,))
    hidden = picture()
    assert (np.abs(shown - hidden).max(axis=-1) > 60).sum() > 300
    x, y = on_screen(pilot, keys(pilot)[1].center)
    pilot.move(x, y)
    pilot.press()
    pilot.release()
    assert pilot.sent(p.ChooseCameraKey) == [], "a hidden key was hit"
    pilot.move(rect.x0 + 5, rect.y1 - 5)
    pilot.key(key.P, modifiers=(SHIFT,))
    assert np.array_equal(picture(), shown)
    pilot.key(key.P)
    assert np.array_equal(picture(), hidden)


def test_where_nothing_can_be_changed_keys_are_still_seen_and_gone_to(pilot: Pilot) -> None:
    session = pilot.session
    session.paths = replace(session.paths, can_edit=False, why_not="It is locked.")
    pilot.draw(2)
    for name in ("paths.key", "paths.new", "paths.turntable", "paths.delete", "paths.loop"):
        pilot.click(name)
    for symbol, modifiers in ((key.C, ()), (key.DELETE, ()), (key.LEFT, (CTRL,)), (key.RIGHT, (ALT, SHIFT))):
        pilot.key(symbol, modifiers=modifiers)
    start = pilot.rects["timeline.key1"].center
    pilot.drag(start, (start[0] - 50, start[1]))
    place = on_screen(pilot, keys(pilot)[0].center)
    pilot.drag(place, (place[0] + 50, place[1]))
    changed = [command for command in session.commands if isinstance(command, p.PathEdit)]
    assert changed == []
    assert session.paths.chosen_key == 0
    pilot.click("paths.go")
    assert session.commands[-1] == p.ChooseCameraKey(0, is_going=True)


def test_thousands_of_keys_cost_no_more_rows_than_are_seen(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession()
    one = session.view.world_to_camera()
    path = replace(begun_path(session), keys=tuple(CameraKey(29.0 * i / 5000, one, 0.8) for i in range(5000)))
    session.paths = replace(session.paths, paths=(path,), chosen=0)
    pilot = open_pilot(session)
    pilot.studio.frame.ui.wanted_panel = PATHS
    pilot.draw(4)
    assert sum(name.startswith("paths.key") for name in pilot.rects) < 60
    assert sum(name.startswith("timeline.key") for name in pilot.rects) < 500
    assert len(session.notices) == 0


def begun_path(session: FakeSession) -> CameraPath:
    """A path with one key."""
    session.dispatch(p.NewCameraPath())
    assert session.paths.path is not None
    return session.paths.path
