"""Marking regions in the window: pointer, wheel, keys, the list, and what is refused. On the made-up session."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from pyglet.window import key

from app.playback.views.scene_axes import rig_radius
from app.session.edit_status import HistoryStatus
from app.session.editing.edit_commands import Redo, Undo
from app.session.editing.mark_commands import MarkRegion, RemoveRegion
from app.session.showing.look_commands import LookThrough
from app.status import ClipStatus
from tests.ui.fake_session import FakeSession, make_rig
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.shell.screenshot import read_window
from ui.style.colors import REGION_COLORS
from ui.viewport.region_tool import FIRST_RADIUS_SHARE, GROWTH, SHIFT_SHARE, RegionTool

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def tool(pilot: Pilot) -> RegionTool:
    return pilot.studio.frame.ui.regions


def sphere_px(pilot: Pilot) -> np.ndarray:
    """Where the middle of the chosen sphere is seen, window coordinates. [2]"""
    view, area = pilot.session.view, pilot.rects["viewport.rendered"]
    K, pose = view.K(round(area.width), round(area.height)), view.world_to_camera()
    in_camera = pose[:3, :3] @ center(pilot) + pose[:3, 3]
    return (K @ in_camera)[:2] / in_camera[2] + [area.x0, area.y0]


def center(pilot: Pilot) -> np.ndarray:
    """Of the chosen sphere. [3]"""
    found = tool(pilot).center
    assert found is not None
    return found


def begin(pilot: Pilot, dx: float = 0.0, dy: float = 0.0) -> None:
    """Point at the scene, press M."""
    x, y = pilot.rects["viewport.canvas"].center
    pilot.move(x + dx, y + dy)
    pilot.key(key.M)


def colored(pilot: Pilot, treat: str) -> int:
    """Pixels of the viewport in the colour of a treatment."""
    image = read_window(pilot.studio.ctx, 1280, 800).astype(int)
    area = pilot.rects["viewport.canvas"]
    inside = image[int(area.y0) + 70 : int(area.y1) - 40, int(area.x0) : int(area.x1)]
    return int((np.abs(inside - 255 * np.array(REGION_COLORS[treat][:3])).max(axis=2) < 40).sum())


def test_the_sphere_lies_on_what_the_pointer_shows_and_enter_marks_it(pilot: Pilot) -> None:
    begin(pilot, 12, -9)
    points = pilot.session.shown_points().points
    assert np.isclose(points, center(pilot)).all(axis=1).any(), "a point of the cloud"
    assert np.abs(sphere_px(pilot) - [pilot.x, pilot.y]).max() < 8.0  # as near as a mark has to be
    eye = -pilot.session.view.world_to_camera()[:3, :3].T @ pilot.session.view.world_to_camera()[:3, 3]
    radius = FIRST_RADIUS_SHARE * float(np.linalg.norm(center(pilot) - eye))
    expected = MarkRegion("static", tuple(center(pilot).tolist()), pytest.approx(radius))  # type: ignore[arg-type]
    pilot.key(key.RETURN)
    assert pilot.sent(MarkRegion) == [expected]
    assert not tool(pilot).is_active


def test_the_pointer_leads_the_sphere_until_a_click_fixes_it(pilot: Pilot) -> None:
    begin(pilot)
    before = sphere_px(pilot)
    pilot.move(pilot.x + 60, pilot.y + 20)
    assert np.abs(sphere_px(pilot) - before - [60, 20]).max() < 16.0  # both are within reach of the pointer
    yaw = pilot.session.view.yaw
    pilot.press()
    pilot.release()
    fixed = center(pilot)
    pilot.move(pilot.x - 90, pilot.y)
    assert np.array_equal(center(pilot), fixed)
    assert pilot.session.view.yaw == yaw, "a click is not a drag"
    pilot.drag((pilot.x, pilot.y), (pilot.x + 50, pilot.y))
    assert pilot.session.view.yaw != yaw
    assert np.array_equal(center(pilot), fixed), "one may look at it from all sides"
    pilot.press()
    pilot.release()
    assert not np.array_equal(center(pilot), fixed), "another click fixes it elsewhere"


def test_the_wheel_sizes_the_sphere_and_with_ctrl_moves_the_view(pilot: Pilot) -> None:
    begin(pilot)
    radius, distance = tool(pilot).radius, pilot.session.view.distance
    pilot.wheel(3)
    assert tool(pilot).radius == pytest.approx(radius * GROWTH**3)
    assert pilot.session.view.distance == distance
    pilot.studio.window.dispatch_event("on_key_press", CTRL, 0)
    pilot.wheel(1)
    pilot.studio.window.dispatch_event("on_key_release", CTRL, 0)
    pilot.draw(2)
    assert tool(pilot).radius == pytest.approx(radius * GROWTH**3)
    assert pilot.session.view.distance == pytest.approx(0.9 * distance)
    pilot.key(key.ESCAPE)
    pilot.wheel(1)
    assert pilot.session.view.distance == pytest.approx(0.81 * distance)


def test_the_whole_job_by_keys_alone(pilot: Pilot) -> None:
    pilot.key(key.M)  # the pointer is not over the scene: the sphere starts in the middle of the picture
    area = pilot.rects["viewport.rendered"]
    assert np.abs(sphere_px(pilot) - area.center).max() < 8.0
    start, radius = center(pilot), tool(pilot).radius
    axes = pilot.session.view.world_to_camera()[:3, :3]
    frame_index = pilot.session.timeline.frame_index
    keys = ((key.RIGHT, (1, 0, 0)), (key.LEFT, (-1, 0, 0)), (key.UP, (0, -1, 0)), (key.DOWN, (0, 1, 0)))
    for symbol, direction in keys:
        before = center(pilot)
        pilot.key(symbol, modifiers=(CTRL,))
        expected = SHIFT_SHARE * radius * (np.array(direction) @ axes)
        np.testing.assert_allclose(center(pilot) - before, expected, atol=1e-9)
    for symbol, sign in ((key.PAGEUP, 1), (key.PAGEDOWN, -1)):
        before = center(pilot)
        pilot.key(symbol)
        np.testing.assert_allclose(center(pilot) - before, sign * SHIFT_SHARE * radius * axes[2], atol=1e-9)
    np.testing.assert_allclose(center(pilot), start, atol=1e-9)
    assert pilot.session.timeline.frame_index == frame_index
    pilot.key(key.MINUS)
    pilot.key(key.EQUAL)
    pilot.key(key.PLUS, modifiers=(SHIFT,))  # the sign as some keyboards have it
    assert tool(pilot).radius == pytest.approx(radius * GROWTH)
    pilot.key(key.M)
    pilot.key(key.RETURN)
    (command,) = pilot.sent(MarkRegion)
    assert command.treat == "dynamic"
    assert command.radius == pytest.approx(radius * GROWTH)
    pilot.key(key.N)
    assert tool(pilot).highlighted == 0
    pilot.key(key.DELETE)
    assert pilot.sent(RemoveRegion) == [RemoveRegion(0)]
    pilot.key(key.Z, modifiers=(CTRL,))
    assert len(pilot.sent(Undo)) == 1
    pilot.key(key.Z, modifiers=(CTRL, SHIFT))
    assert pilot.sent(Redo) == [], "nothing was taken back yet"
    pilot.session.history = HistoryStatus(undo="mark a region", redo="mark a region")
    pilot.key(key.Z, modifiers=(CTRL, SHIFT))
    pilot.key(key.Y, modifiers=(CTRL,))
    pilot.click("edits.redo")
    assert len(pilot.sent(Redo)) == 3
    assert len(pilot.sent(Undo)) == 1


def test_escape_leaves_without_marking_and_keys_of_choosing_do_nothing_then(pilot: Pilot) -> None:
    begin(pilot)
    pilot.key(key.F1)
    pilot.key(key.ESCAPE)
    assert tool(pilot).is_active, "Escape closes the sheet first"
    pilot.key(key.ESCAPE)
    assert not tool(pilot).is_active
    radius = tool(pilot).radius
    for symbol in (key.RETURN, key.ESCAPE, key.MINUS, key.PAGEUP, key.DELETE, key.N):
        pilot.key(symbol)
    pilot.key(key.Z, modifiers=(CTRL,))
    assert pilot.session.commands == []
    assert (tool(pilot).radius, tool(pilot).is_accepted) == (radius, False)


def test_enter_in_the_same_moment_as_a_move_marks_where_the_pointer_is(pilot: Pilot) -> None:
    begin(pilot)
    window = pilot.studio.window
    x, y = pilot.x + 60, pilot.y - 30
    window.dispatch_event("on_mouse_motion", x, window.height - 1 - y, 60, 30)
    window.dispatch_event("on_key_press", key.RETURN, 0)
    window.dispatch_event("on_key_release", key.RETURN, 0)
    while pilot.studio.frame.backend.needs_follow_up:
        pilot.draw()
    (command,) = pilot.sent(MarkRegion)
    tool(pilot).is_active, tool(pilot).center = True, np.array(command.center)
    assert np.abs(sphere_px(pilot) - [x, y]).max() < 8.0


def test_an_anchor_under_the_pointer_is_taken_where_anchors_are_shown(pilot: Pilot) -> None:
    session = pilot.session
    session.clip_states[0] = ClipStatus("trained", 1.0)
    pilot.key(key.TAB)
    begin(pilot)
    anchors = session.shown_anchors()
    everything = np.concatenate([anchors.inherited_positions, anchors.own_positions])
    assert np.isclose(everything, center(pilot)).all(axis=1).any()
    counts = pilot.studio.frame.viewport.scene.regions.counts
    inside = np.linalg.norm(everything - center(pilot), axis=1) <= tool(pilot).radius
    assert sum(counts.values()) == inside.sum() > 0


def test_through_a_camera_a_click_fixes_and_the_view_stays(pilot: Pilot) -> None:
    pilot.session.dispatch(LookThrough(2))
    pilot.draw(2)
    begin(pilot, 10, 10)
    assert np.abs(sphere_px(pilot) - [pilot.x, pilot.y]).max() < 8.0
    pilot.press()
    pilot.release()
    assert tool(pilot).is_placed
    assert pilot.session.view.look_through == 2


def test_buttons_and_slider_of_the_panel(pilot: Pilot) -> None:
    pilot.click("viewport.mark")
    pilot.draw(2)
    assert tool(pilot).is_active
    pilot.click("regions.moving")
    assert tool(pilot).treat == "dynamic"
    pilot.click("regions.static")
    assert tool(pilot).treat == "static"
    slider = pilot.rects["regions.radius"]
    radius = tool(pilot).radius
    pilot.drag((slider.x0 + 20, slider.center[1]), (slider.x0 + 0.6 * slider.width, slider.center[1]))
    low, high = tool(pilot).radius_limits
    assert tool(pilot).radius != radius
    assert low <= tool(pilot).radius <= high
    pilot.click("regions.cancel")
    pilot.draw(2)
    assert not tool(pilot).is_active
    pilot.click("regions.begin")
    pilot.draw(2)
    pilot.click("regions.accept")
    pilot.draw(2)
    assert len(pilot.sent(MarkRegion)) == 1
    pilot.click("edits.undo")
    assert len(pilot.sent(Undo)) == 1


def test_the_list_highlights_and_removes(pilot: Pilot) -> None:
    for x in (0.0, 1.0, 2.0):
        pilot.session.dispatch(MarkRegion("static", (x, 0.0, 0.0), 0.2))
    pilot.key(key.N)
    assert tool(pilot).highlighted == 0
    pilot.draw(2)
    pilot.click("regions.row2")
    assert tool(pilot).highlighted == 2
    pilot.click("regions.remove0")
    assert pilot.sent(RemoveRegion) == [RemoveRegion(0)]
    pilot.draw(2)
    assert tool(pilot).highlighted is None, "there is no third one any more"
    for expected in (0, 1, None, 0):
        pilot.key(key.N)
        assert tool(pilot).highlighted == expected


def test_where_nothing_can_be_marked_it_says_why(pilot: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr("ui.panels.editing.panel.marks.text_warning", said.append)
    session = pilot.session
    session.dispatch(MarkRegion("static", (0.0, 0.0, 0.0), 0.2))
    session.regions = dataclasses.replace(session.regions, can_mark=False, why_not="It is locked.")
    session.history = HistoryStatus()
    session.commands.clear()
    begin(pilot)
    pilot.draw(2)
    assert said[-1] == "It is locked."
    assert not tool(pilot).is_active
    for name in ("viewport.mark", "regions.begin", "regions.remove0", "edits.undo"):
        pilot.click(name)
    pilot.key(key.N)
    pilot.key(key.DELETE)
    pilot.key(key.Z, modifiers=(CTRL,))
    assert session.commands == []


def test_choosing_ends_when_the_project_is_taken_away_or_another_capture_comes(pilot: Pilot) -> None:
    session = pilot.session
    begin(pilot)
    can_mark = session.regions
    session.regions = dataclasses.replace(can_mark, can_mark=False)
    pilot.draw()
    assert not tool(pilot).is_active
    session.regions = can_mark
    begin(pilot)
    assert tool(pilot).is_active
    session.rig = make_rig(5)
    pilot.draw()
    assert not tool(pilot).is_active
    assert tool(pilot).radius == 0.0, "the next scene may be of another size"


@pytest.mark.usefixtures("lasting_notices")
def test_without_a_capture_the_panel_says_so(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.key(key.M)
    pilot.draw(2)
    assert not tool(pilot).is_active
    [notice] = pilot.session.notices
    assert notice.kind != "error", "the key says why it does nothing"


def test_the_sphere_is_seen_in_its_colour_and_5_hides_what_is_marked(pilot: Pilot) -> None:
    session = pilot.session
    session.dispatch(LookThrough(None))
    session.overlays.show_points = session.overlays.show_frusta = False
    pilot.draw(2)
    assert colored(pilot, "static") == colored(pilot, "dynamic") == 0
    begin(pilot)
    pilot.wheel(8)
    assert colored(pilot, "static") > 150
    pilot.key(key.M)
    assert colored(pilot, "static") == 0
    assert colored(pilot, "dynamic") > 80
    pilot.key(key.RETURN)
    assert colored(pilot, "dynamic") > 50
    pilot.key(key._5)
    assert colored(pilot, "dynamic") == 0


def test_radii_stay_within_what_suits_the_scene(pilot: Pilot) -> None:
    begin(pilot)
    low, high = tool(pilot).radius_limits
    assert high == pytest.approx(2.0 * rig_radius(pilot.session.rig))
    for ticks, expected in ((200, high), (-400, low)):
        pilot.wheel(ticks)
        assert tool(pilot).radius == pytest.approx(expected)
