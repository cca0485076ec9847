"""What mouse and keys do over the picture with each preset, in the real window; the popup of lens and bookmarks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key, mouse

from app.playback.views.orbit_view import OrbitView
from app.playback.views.view_motion import EASE_S
from app.session.editing.mark_commands import MarkRegion
from app.session.projects.window_memory import WindowMemory, read_window_memory
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.actions.key import parse_key
from ui.panels.actions.table import ACTIONS
from ui.panels.picture.gestures import FLY_KEYS, GESTURE_WORDS, PRESETS, Navigation, gesture_rows, mouse_help
from ui.panels.picture.gizmo import gizmo_tips, tip_under
from ui.panels.picture.pointer import PX_PER_STEP
from ui.panels.state import Rect

pytestmark = [pytest.mark.gl, pytest.mark.slow]

ALT = key.LALT
HELD = {"Ctrl": CTRL, "Shift": SHIFT, "Alt": ALT}
BUTTONS = {"Left": mouse.LEFT, "Middle": mouse.MIDDLE, "Right": mouse.RIGHT}


@contextmanager
def held(pilot: Pilot, modifiers: str) -> Iterator[None]:
    """While this lasts, these keys are down."""
    keys = [HELD[word] for word in modifiers.split("+") if word]
    for symbol in keys:
        pilot.studio.window.dispatch_event("on_key_press", symbol, 0)
        pilot.draw()
    yield
    for symbol in keys:
        pilot.studio.window.dispatch_event("on_key_release", symbol, 0)
        pilot.draw()


def changes(pilot: Pilot, act: Callable[[], None]) -> set[str]:
    """What something does to the view, in the words of gestures; without anything under the pointer to turn about."""
    pilot.session._points[:] = 1e3  # far outside of the picture
    pilot.session.overlays.show_points = pilot.session.overlays.show_frusta = False
    view = pilot.session.view
    before = (view.yaw, view.pitch, view.roll, view.fov_y, view.distance, view.pivot.copy(), view.eye)
    act()
    after = (view.yaw, view.pitch, view.roll, view.fov_y, view.distance, view.pivot.copy(), view.eye)
    has_changed = [not np.allclose(a, b, atol=1e-9) for a, b in zip(before, after, strict=True)]
    yaw, pitch, roll, fov, distance, pivot, eye = has_changed
    found = set()
    if yaw or pitch:
        found.add("look" if pivot and not eye else "orbit")
    elif pivot:
        found.add("pan")
    if roll:
        found.add("roll")
    if fov:
        found.add("lens")
    if distance:
        found.add("dolly")
    return found


DRAGS = [(preset.name, *chord, gesture) for preset in PRESETS.values() for chord, gesture in preset.drags.items()]
TURNS = [(preset.name, *row) for preset in PRESETS.values() for row in preset.wheel.items()]


@pytest.mark.parametrize(("preset", "button", "modifiers", "gesture"), DRAGS)
def test_each_drag_of_each_preset_does_what_its_table_says(pilot, preset, button, modifiers, gesture) -> None:
    pilot.studio.frame.ui.navigation.preset_name = preset
    x, y = pilot.rects["viewport.canvas"].center
    with held(pilot, modifiers):
        did = changes(pilot, lambda: pilot.drag((x, y), (x + 40, y + 25), button=BUTTONS[button]))
    assert did == {gesture}


@pytest.mark.parametrize(("preset", "modifiers", "gesture"), TURNS)
def test_each_turn_of_the_wheel_of_each_preset_does_what_its_table_says(pilot, preset, modifiers, gesture) -> None:
    pilot.studio.frame.ui.navigation.preset_name = preset
    pilot.move(*pilot.rects["viewport.canvas"].center)
    with held(pilot, modifiers):
        assert changes(pilot, lambda: pilot.wheel(0.25)) == {gesture}, "touchpads send parts of a step"


def test_the_left_button_of_the_blender_preset_does_nothing_but_click(pilot: Pilot) -> None:
    pilot.studio.frame.ui.navigation.preset_name = "blender"
    x, y = pilot.rects["viewport.canvas"].center
    assert changes(pilot, lambda: pilot.drag((x, y), (x + 40, y + 25))) == set()
    pilot.session.overlays.show_points = True
    pilot.key(key.M)
    pilot.tap(x, y)
    assert pilot.studio.frame.ui.regions.is_placed, "a region can still be placed"


def seen_at(pilot: Pilot, point: np.ndarray) -> np.ndarray:
    """Where a point of the scene is drawn in the window. [2]"""
    area, view = pilot.rects["viewport.rendered"], pilot.session.view
    in_camera = view.world_to_camera() @ np.append(point, 1.0)
    x, y, z = view.K(round(area.width), round(area.height)) @ in_camera[:3]
    return np.array([area.x0 + x / z, area.y0 + y / z])


def a_point(pilot: Pilot) -> tuple[np.ndarray, tuple[float, float]]:
    """A lone point of the cloud beside the middle, and where it is drawn."""
    point = np.array([0.35, -0.1, 0.2])
    pilot.session._points[:] = point
    pilot.session.overlays.show_frusta = False
    x, y = seen_at(pilot, point)
    return point, (float(x), float(y))


@pytest.mark.parametrize("is_orthographic", [False, True])
def test_what_is_under_the_pointer_stays_there_while_one_orbits_moves_and_comes_nearer(pilot, is_orthographic) -> None:
    view = pilot.session.view
    view.set_orthographic(is_orthographic)
    point, at = a_point(pilot)
    yaw = view.yaw
    pilot.drag(at, (at[0] + 50, at[1] + 20))
    assert view.yaw != yaw
    assert np.abs(seen_at(pilot, point) - at).max() < 0.2
    pilot.drag(at, (at[0] + 60, at[1] - 30), button=mouse.RIGHT)
    assert np.abs(seen_at(pilot, point) - [at[0] + 60, at[1] - 30]).max() < 0.2, "it follows the pointer"
    distance = view.distance
    pilot.wheel(3)
    assert view.distance == pytest.approx(0.9**3 * distance)
    assert np.abs(seen_at(pilot, point) - [at[0] + 60, at[1] - 30]).max() < 0.5


def test_a_double_click_brings_what_is_there_into_the_middle(pilot: Pilot) -> None:
    point, at = a_point(pilot)
    for _ in range(2):
        pilot.move(*at)
        pilot.press()
        pilot.release()
    assert np.allclose(pilot.session.view.pivot, point, atol=0.02)
    assert np.abs(seen_at(pilot, pilot.session.view.pivot) - pilot.rects["viewport.rendered"].center).max() < 1.0
    before = pilot.session.view.world_to_camera()
    away = (at[0] + 120, at[1] + 120)
    for _ in range(2):
        pilot.move(*away)
        pilot.press()
        pilot.release()
    assert np.array_equal(pilot.session.view.world_to_camera(), before), "there is nothing"


def hold(pilot: Pilot, symbol: int, frames: int) -> None:
    pilot.studio.window.dispatch_event("on_key_press", symbol, 0)
    pilot.draw(frames)
    pilot.studio.window.dispatch_event("on_key_release", symbol, 0)
    pilot.draw(40)


@pytest.mark.parametrize(("letter", "move"), FLY_KEYS.items())
def test_held_keys_fly_and_the_view_comes_to_rest(pilot: Pilot, letter, move) -> None:
    view = pilot.session.view
    eye, pivot, axes = view.eye, view.pivot.copy(), view.rotation
    directions = np.stack([axes[0], view.up, axes[2]])
    hold(pilot, getattr(key, letter.upper()), 30)
    moved = view.eye - eye
    assert np.allclose(view.pivot - pivot, moved)
    assert moved @ (move @ directions) / np.linalg.norm(moved) == pytest.approx(1.0)
    # half a second at half a radius per second
    assert np.linalg.norm(moved) == pytest.approx(0.25 * view.radius, rel=0.1)
    pilot.rest()
    assert not pilot.session.timeline.is_every_frame


def test_shift_flies_ten_times_as_fast_and_alt_a_tenth(pilot: Pilot) -> None:
    view, moved = pilot.session.view, []
    for modifiers in ("", "Shift", "Alt"):
        eye = view.eye
        with held(pilot, modifiers):
            hold(pilot, key.D, 20)
        moved.append(float(np.linalg.norm(view.eye - eye)))
    assert moved[1] == pytest.approx(10 * moved[0], rel=0.15)
    assert moved[2] == pytest.approx(0.1 * moved[0], rel=0.15)


def test_flying_leaves_a_camera_and_letters_in_a_text_field_do_not_fly(pilot: Pilot) -> None:
    pilot.session.view.look(2)
    hold(pilot, key.W, 5)
    assert pilot.session.view.look_through is None
    eye = pilot.session.view.eye
    pilot.click("timeline.frame")
    hold(pilot, key.W, 10)
    assert np.array_equal(pilot.session.view.eye, eye)


def test_a_letter_that_outlasts_its_ctrl_does_not_fly_until_it_is_pressed_again(pilot: Pilot) -> None:
    pilot.session.view.look(2)
    with held(pilot, "Ctrl"):
        pilot.studio.window.dispatch_event("on_key_press", key.D, 0)
        pilot.draw(2)
    pilot.draw(5)
    assert pilot.session.view.look_through == 2
    pilot.studio.window.dispatch_event("on_key_release", key.D, 0)
    pilot.draw(2)
    hold(pilot, key.D, 5)
    assert pilot.session.view.look_through is None


@pytest.mark.parametrize("preset", PRESETS)
def test_while_one_flies_a_button_looks_around(pilot: Pilot, preset: str) -> None:
    pilot.studio.frame.ui.navigation.preset_name = preset
    view = pilot.session.view
    x, y = pilot.rects["viewport.canvas"].center
    pilot.studio.window.dispatch_event("on_key_press", key.W, 0)
    pilot.draw(3)
    yaw = view.yaw
    pilot.drag((x, y), (x + 60, y), button=BUTTONS[PRESETS[preset].look_button])
    pilot.studio.window.dispatch_event("on_key_release", key.W, 0)
    pilot.draw(2)
    assert view.yaw < yaw, "to the right, where orbiting would turn to the left"


def test_no_action_wants_the_keys_that_fly() -> None:
    taken = {parsed.chord for action in ACTIONS for parsed in map(parse_key, action.keys)}
    for letter in FLY_KEYS:
        for is_shift, is_alt in itertools.product((False, True), repeat=2):
            assert (letter, False, is_shift, is_alt) not in taken


def test_the_axes_in_the_corner_are_clicked_and_dragged(pilot: Pilot) -> None:
    view, rect = pilot.session.view, pilot.rects["viewport.gizmo"]
    tip = next(tip for tip in gizmo_tips(view, rect) if (tip.axis, tip.sign) == (0, 1))
    expected = OrbitView(pilot.session.rig)
    expected.look_along(tip.name)
    pilot.drag((tip.x, tip.y), (tip.x, tip.y))
    assert np.allclose(view.rotation, expected.rotation)
    assert np.allclose(view.pivot, expected.pivot)
    yaw = view.yaw
    pilot.drag(rect.center, (rect.center[0] + 30, rect.center[1]))
    assert view.yaw - yaw == pytest.approx(0.18, abs=1e-6)


def test_the_nearest_axis_under_the_pointer_is_meant_and_none_beside_them() -> None:
    view, rect = FakeSession().view, Rect(0, 0, 82, 82)
    view.look_along("front")
    found = tip_under(view, rect, *rect.center)
    assert found is not None
    assert found.name == "front"
    assert tip_under(view, rect, 3.0, 3.0) is None


def test_a_small_picture_has_no_axes(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(size=(900, 600))
    pilot.session.views.show(4)
    pilot.draw(3)
    assert "viewport.gizmo" not in pilot.rects


@pytest.mark.parametrize(
    ("symbol", "modifiers", "name"),
    [
        (key.NUM_1, (), "front"),
        (key.NUM_3, (), "right"),
        (key.NUM_7, (), "top"),
        (key.NUM_1, (CTRL,), "back"),
        (key.NUM_3, (CTRL,), "left"),
        (key._7, (CTRL, ALT), "bottom"),
        (key._1, (ALT,), "front"),
    ],
)
def test_axis_views_by_key(pilot: Pilot, symbol: int, modifiers: tuple[int, ...], name: str) -> None:
    expected = OrbitView(pilot.session.rig)
    expected.look_along(name)
    pilot.key(symbol, modifiers=modifiers)
    assert np.allclose(pilot.session.view.rotation, expected.rotation)


def test_lens_leaning_and_perspective_by_key(pilot: Pilot) -> None:
    view = pilot.session.view
    pilot.key(key.NUM_5)
    assert view.is_orthographic
    pilot.key(key._5, modifiers=(ALT,))
    assert not view.is_orthographic
    pilot.key(key.BRACKETRIGHT, modifiers=(SHIFT,))
    assert view.roll > 0.0
    pilot.key(key.BACKSLASH, modifiers=(SHIFT,))
    assert view.roll == 0.0
    fov = view.fov_y
    pilot.key(key.MINUS, modifiers=(ALT,))
    assert view.fov_y > fov


def test_framing_by_key_takes_what_is_highlighted_then_the_pivot_then_all(pilot: Pilot) -> None:
    view, rotation = pilot.session.view, pilot.session.view.rotation
    pilot.session.dispatch(MarkRegion("static", (0.5, 0.2, -0.4), 0.1))
    pilot.key(key.N)
    pilot.key(key.F, modifiers=(SHIFT,))
    assert np.allclose(view.pivot, [0.5, 0.2, -0.4])
    assert np.allclose(view.rotation, rotation)
    near = view.distance
    pilot.key(key.N)
    pilot.key(key.F, modifiers=(SHIFT,))
    assert np.allclose(view.pivot, [0.5, 0.2, -0.4])
    assert view.distance > near, "more is seen around a pivot than of a small region"
    view.look_along("top")
    pilot.key(key.F, modifiers=(ALT,))
    assert np.allclose(view.pivot, pilot.session.rig.focus_point())
    assert np.allclose(view.forward, -view.up)
    pilot.key(key.F)
    assert abs(view.forward @ view.up) < 0.9


def test_jumps_are_eased_and_input_stops_them(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(is_eased=True)
    view = pilot.session.view
    start = view.world_to_camera()
    pilot.click("capture.camera3")
    assert view.look_through == 3
    assert not np.array_equal(view.world_to_camera(), pilot.session.rig.world_to_camera[3])
    pilot.draw(round(EASE_S * 60) + 2)
    assert np.array_equal(view.world_to_camera(), pilot.session.rig.world_to_camera[3])
    pilot.key(key.F)
    pilot.draw(2)
    assert view.is_moving
    assert not np.allclose(view.world_to_camera(), start, atol=1e-3)
    pilot.move(*pilot.rects["viewport.canvas"].center)
    pilot.wheel(1)
    assert not view.is_moving
    assert not np.allclose(view.world_to_camera()[2, :3], start[2, :3], atol=1e-3), "it stays where it has come to"
    pilot.rest()


def test_reduced_motion_jumps(pilot: Pilot) -> None:
    pilot.click("capture.camera3")
    assert np.array_equal(pilot.session.view.world_to_camera(), pilot.session.rig.world_to_camera[3])


NAMES = ["plain", "100 %s %n", "a##b", "two\nlines", "שלום"]


def test_bookmarks_of_any_name_are_kept_gone_to_and_removed(pilot: Pilot) -> None:
    session, view = pilot.session, pilot.session.view
    pilot.key(key.B, modifiers=(CTRL,))
    pilot.draw(2)
    for i, name in enumerate(NAMES):
        view.look_along(("front", "right", "top", "left", "back")[i])
        pilot.click("look.name")
        pilot.type(name)
        pilot.key(key.ENTER)
    kept = [item.name for item in session.bookmarks.items]
    assert kept == [name.replace("\n", "") for name in NAMES], "what is typed is one line"
    assert [item.number for item in session.bookmarks.items] == [1, 2, 3, 4, 5]
    pilot.click("look.remove1")
    pilot.draw(2)
    assert "שלום" in [item.name for item in session.bookmarks.items]
    assert len(session.bookmarks.items) == 4
    view.home()
    pilot.click("look.bookmark0")
    expected = OrbitView(session.rig)
    expected.look_along("front")
    assert np.allclose(view.rotation, expected.rotation)
    assert len(session.notices) == 0


def test_bookmarks_by_key_and_with_their_frame(pilot: Pilot) -> None:
    session, view = pilot.session, pilot.session.view
    view.look(4)
    pilot.key(key._3, modifiers=(CTRL, SHIFT))
    view.look_along("right")
    pilot.key(key._4, modifiers=(CTRL, SHIFT))
    there = view.world_to_camera()
    view.home()
    pilot.key(key._3, modifiers=(CTRL,))
    assert view.look_through == 4
    pilot.key(key._4, modifiers=(CTRL,))
    assert np.allclose(view.world_to_camera(), there)
    pilot.key(key._9, modifiers=(CTRL,))
    assert np.allclose(view.world_to_camera(), there), "nothing is kept there"
    session.timeline.seek(12)
    pilot.click("viewport.look")
    pilot.draw(2)
    pilot.click("look.with_frame")
    pilot.click("look.keep")
    session.timeline.seek(3)
    pilot.draw(2)
    pilot.click("look.bookmark2")
    assert session.timeline.frame_index == 12


def test_the_popup_changes_lens_axes_and_what_is_up(pilot: Pilot) -> None:
    view = pilot.session.view
    pilot.click("viewport.look")
    pilot.draw(2)
    rect = pilot.rects["look.fov"]
    pilot.drag(rect.center, (rect.x1 - 5, rect.center[1]))
    assert view.fov_y > 2.0
    pilot.click("look.orthographic")
    assert view.is_orthographic
    view.lean(0.2)
    pilot.draw(2)
    pilot.click("look.upright")
    assert view.roll == 0.0
    pilot.click("look.left")
    assert np.allclose(view.rotation[0] @ view.up, 0.0)
    pilot.click("look.frame_all")
    assert np.allclose(view.pivot, pilot.session.rig.focus_point())
    pilot.click("look.up")
    pilot.draw(2)
    pilot.click("look.up+z")
    assert np.array_equal(view.up, [0.0, 0.0, 1.0])
    pilot.click("look.preset")
    pilot.draw(2)
    pilot.click("look.preset.blender")
    assert pilot.studio.frame.ui.navigation.preset.name == "blender"


def test_views_bookmarks_and_presets_come_back(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_pilot(memory=WindowMemory(path))
    pilot.session.view.look_along("right")
    pilot.session.view.lean(0.3)
    pilot.session.view.set_up_axis("-z")
    pilot.session.view.set_orthographic(True)
    pilot.key(key._2, modifiers=(CTRL, SHIFT))
    pilot.studio.frame.ui.navigation.preset_name = "touchpad"
    pilot.studio.frame.remembering.save(pilot.session)
    kept = pilot.session.view.world_to_camera()
    pilot.studio.close()
    again = open_pilot(memory=read_window_memory(path))
    again.draw(2)
    assert np.allclose(again.session.view.world_to_camera(), kept)
    assert again.session.view.is_orthographic
    assert again.session.view.up_axis == "-z"
    assert again.session.bookmarks.items == pilot.session.bookmarks.items
    assert again.studio.frame.ui.navigation.preset.name == "touchpad"


@pytest.mark.parametrize("preset", PRESETS.values(), ids=lambda preset: preset.name)
def test_the_help_sheet_says_what_the_preset_does(preset) -> None:
    rows = mouse_help(preset)
    assert len({done for done, _ in rows}) == len(rows)
    for (button, modifiers), gesture in preset.drags.items():
        chord = f"{modifiers.replace('+', ' + ')} + {button.lower()} drag" if modifiers else f"{button} drag"
        assert (chord, GESTURE_WORDS[gesture]) in rows
    assert len(gesture_rows(preset)) == len(preset.drags) + len(preset.wheel) + 1
    assert (f"Flying + {preset.look_button.lower()} drag", GESTURE_WORDS["look"]) in rows


def test_a_preset_that_is_not_known_counts_as_the_first() -> None:
    assert Navigation("no such thing").preset is PRESETS["studio"]
    assert PX_PER_STEP > 0
