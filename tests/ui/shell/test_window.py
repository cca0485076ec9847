"""The whole window on a made-up session: pointer, keys, panels, failures. No display, a fixed clock."""

from __future__ import annotations

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from pyglet.window import key, mouse

from app.playback.modes.arrays import AnchorArrays
from app.session.commands import DismissNotice
from app.session.projects.project_commands import OpenCapture
from app.session.projects.setting_commands import SetPreset, SetTrainSetting
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import LookThrough, SetCompare, SetFrame, ToggleOverlay, TogglePlay
from app.session.training.train_commands import PauseTraining, StopTraining, TrainNextClip
from app.status import ClipStatus
from engine.clip_files.roles import ROLES
from engine.gate.reasons import USER_DYNAMIC
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from tests.ui.real_session import draw_until
from ui.gl import frusta_lines
from ui.shell.screenshot import read_window, write_png
from ui.viewport.layers.frusta import frustum_size

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def test_dragging_along_the_timeline_visits_the_frames_under_the_pointer(pilot: Pilot) -> None:
    track = pilot.rects["timeline.track"]
    y = track.y0 + 12
    cell = track.width / pilot.session.timeline.n_frames
    pilot.drag((track.x0 + 2.5 * cell, y), (track.x0 + 20.5 * cell, y), steps=6)
    assert [command.frame_index for command in pilot.sent(SetFrame)] == [2, 5, 8, 11, 14, 17, 20]
    assert pilot.session.timeline.frame_index == 20


def test_scrubbing_beyond_the_track_stays_inside_the_capture(pilot: Pilot) -> None:
    track = pilot.rects["timeline.track"]
    pilot.drag((track.center[0], track.y0 + 12), (track.x1 + 3, track.y0 + 12))
    assert pilot.session.timeline.frame_index == pilot.session.timeline.n_frames - 1


def test_left_drag_orbits_by_the_pointer_s_path(pilot: Pilot) -> None:
    view, (x, y) = pilot.session.view, pilot.rects["viewport.canvas"].center
    expected = FakeSession().view
    expected.orbit(80, 40)
    pilot.drag((x, y), (x + 80, y + 40))
    # both are sums of the same small moves in another order
    assert view.yaw == pytest.approx(expected.yaw, abs=1e-6)
    assert view.pitch == pytest.approx(expected.pitch, abs=1e-6)


def test_the_way_to_the_press_is_no_drag(pilot: Pilot) -> None:
    view, (x, y) = pilot.session.view, pilot.rects["viewport.canvas"].center
    pilot.move(*pilot.rects["timeline.track"].center)
    yaw = view.yaw
    up = pilot.studio.window.height - 1 - y
    pilot.studio.window.dispatch_event("on_mouse_motion", x, up, 50, 300)
    pilot.studio.window.dispatch_event("on_mouse_press", x, up, mouse.LEFT, 0)
    pilot.draw(2)
    assert view.yaw == yaw
    pilot.studio.window.dispatch_event("on_mouse_release", x, up, mouse.LEFT, 0)
    pilot.draw(2)


def test_a_drag_that_ends_between_two_frames_counts_in_full(pilot: Pilot) -> None:
    view, (x, y) = pilot.session.view, pilot.rects["viewport.canvas"].center
    track = pilot.rects["timeline.track"]
    up = pilot.studio.window.height - 1
    for start, stop in (((x, y), (x + 50, y)), ((track.x0 + 3, track.y0 + 9), (track.x1 - 3, track.y0 + 9))):
        yaw = view.yaw
        pilot.move(*start)
        pilot.press()
        pilot.studio.window.dispatch_event("on_mouse_drag", stop[0], up - stop[1], 50, 0, mouse.LEFT, 0)
        pilot.studio.window.dispatch_event("on_mouse_release", stop[0], up - stop[1], mouse.LEFT, 0)
        pilot.draw(3)
        if start == (x, y):
            assert view.yaw - yaw == pytest.approx(0.3, abs=1e-6)  # 0.006 radians per pixel
    assert pilot.session.timeline.frame_index == pilot.session.timeline.n_frames - 1


def test_right_drag_pans_and_keeps_the_angles(pilot: Pilot) -> None:
    view, (x, y) = pilot.session.view, pilot.rects["viewport.canvas"].center
    yaw, pivot = view.yaw, np.array(view.pivot)
    pilot.drag((x, y), (x + 60, y), button=mouse.RIGHT)
    assert view.yaw == yaw
    assert np.linalg.norm(view.pivot - pivot) > 0.01 * view.distance


def test_shift_middle_drag_pans_like_right_drag(pilot: Pilot) -> None:
    view, (x, y) = pilot.session.view, pilot.rects["viewport.canvas"].center
    yaw, pivot = view.yaw, np.array(view.pivot)
    pilot.studio.window.dispatch_event("on_key_press", SHIFT, 0)
    pilot.drag((x, y), (x + 60, y), button=mouse.MIDDLE)
    pilot.studio.window.dispatch_event("on_key_release", SHIFT, 0)
    assert view.yaw == yaw
    assert np.linalg.norm(view.pivot - pivot) > 0.01 * view.distance


def test_wheel_moves_nearer_over_the_viewport_only(pilot: Pilot) -> None:
    view, before = pilot.session.view, pilot.session.view.distance
    pilot.move(*pilot.rects["viewport.canvas"].center)
    pilot.wheel(2)
    assert view.distance == pytest.approx(before * 0.81, rel=1e-6)  # 0.9 per tick
    pilot.move(*pilot.rects["timeline.track"].center)
    pilot.wheel(2)
    assert view.distance == pytest.approx(before * 0.81, rel=1e-6)


def test_orbiting_leaves_the_capture_camera(pilot: Pilot) -> None:
    pilot.click("capture.camera2")
    assert pilot.session.view.look_through == 2
    x, y = pilot.rects["viewport.canvas"].center
    pilot.drag((x, y), (x + 30, y))
    assert pilot.session.view.look_through is None


def test_play_by_button_and_by_space(pilot: Pilot) -> None:
    pilot.click("timeline.play")
    assert pilot.session.timeline.is_playing
    pilot.key(key.SPACE)
    assert not pilot.session.timeline.is_playing
    assert len(pilot.sent(TogglePlay)) == 2


def test_train_button_and_key_ask_for_the_next_clip(pilot: Pilot) -> None:
    pilot.click("training.next")
    pilot.key(key.T)
    assert len(pilot.sent(TrainNextClip)) == 2


def test_the_plan_of_the_next_clip_folds_out_and_settings_can_be_typed(pilot: Pilot) -> None:
    assert "plan.summary" in pilot.rects
    assert "plan.joint_steps" not in pilot.rects
    pilot.click("plan.header")
    pilot.draw(2)
    pilot.click("plan.joint_steps")
    pilot.key(key.A, modifiers=(key.LCTRL,))
    pilot.type("500")
    pilot.key(key.ENTER)
    assert pilot.sent(SetTrainSetting) == [SetTrainSetting("joint_steps", 500)]
    pilot.click("plan.preset")
    pilot.draw(2)
    pilot.click("plan.preset.toy")
    assert pilot.sent(SetPreset) == [SetPreset("toy")]


def test_quality_over_the_clips_folds_out_by_pointer_and_keyboard(pilot: Pilot) -> None:
    session = pilot.session
    pilot.draw(2)
    assert "quality.header" not in pilot.rects
    session.clip_states[0] = ClipStatus("trained", 1.0, 31.2, exposure_change=0.0)
    session.clip_states[1] = ClipStatus("trained", 1.0, 29.9, exposure_change=0.028)
    pilot.draw(2)
    assert "quality.psnr" not in pilot.rects
    pilot.click("quality.header")
    pilot.draw(2)
    assert {"quality.psnr", "quality.exposure"} <= pilot.rects.keys()
    assert pilot.rects["quality.psnr"].width > 100
    pilot.key(key._6)
    pilot.draw(2)
    assert "quality.psnr" not in pilot.rects
    pilot.key(key._6)
    pilot.draw(2)
    assert "quality.psnr" in pilot.rects


def test_settings_of_a_trained_project_cannot_be_typed(pilot: Pilot) -> None:
    pilot.session.plan = dataclasses.replace(pilot.session.plan, can_edit=False)
    pilot.click("plan.header")
    pilot.draw(2)
    pilot.click("plan.joint_steps")
    pilot.type("5")
    pilot.key(key.ENTER)
    pilot.click("plan.preset")
    pilot.draw(2)
    assert "plan.preset.toy" not in pilot.rects
    assert pilot.sent(SetTrainSetting) == []


def test_running_training_offers_pause_and_stop(pilot: Pilot) -> None:
    session = pilot.session
    session.training = dataclasses.replace(session.training, state="running", clip_index=0, step=5, n_steps=100)
    session.clip_states[0] = ClipStatus("training", 0.05)
    pilot.draw(2)
    assert "training.next" not in pilot.rects
    pilot.click("training.pause")
    pilot.click("training.stop")
    pilot.key(key.T)
    assert len(pilot.sent(PauseTraining)) == 2
    assert len(pilot.sent(StopTraining)) == 1


def test_train_key_does_nothing_when_nothing_can_be_trained(pilot: Pilot) -> None:
    pilot.session.training = dataclasses.replace(pilot.session.training, can_train_next=False, next_clip_index=None)
    pilot.key(key.T)
    pilot.click("training.next")
    assert pilot.sent(TrainNextClip) == []


def test_arrow_home_end_and_clip_keys(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    visited = []
    for symbol in (key.RIGHT, key.RIGHT, key.LEFT, key.DOWN, key.DOWN, key.UP, key.END, key.HOME):
        pilot.key(symbol)
        visited.append(timeline.frame_index)
    assert visited == [1, 2, 1, 10, 20, 10, 29, 0]


def test_compare_key_takes_the_nearest_camera_and_cycles(pilot: Pilot) -> None:
    for _ in range(4):
        pilot.key(key.G)
    assert [command.mode for command in pilot.sent(SetCompare)] == ["wipe", "side", "blink", "off"]
    assert len(pilot.sent(LookThrough)) == 1


def test_wipe_line_follows_the_pointer_and_does_not_orbit(pilot: Pilot) -> None:
    pilot.key(key.G)
    camera = pilot.session.view.look_through
    rect = pilot.rects["viewport.rendered"]
    y = rect.center[1] - 40
    pilot.drag((rect.x0 + rect.width * 0.5, y), (rect.x0 + rect.width * 0.25, y))
    assert pilot.session.overlays.wipe_position == pytest.approx(0.25, abs=0.01)  # a pixel of a 700 px picture
    assert pilot.session.view.look_through == camera


def test_bracket_keys_walk_the_cameras_around(pilot: Pilot) -> None:
    pilot.session.view.look(0)
    pilot.key(key.BRACKETLEFT)
    assert pilot.session.view.look_through == len(pilot.session.rig) - 1
    pilot.key(key.BRACKETRIGHT)
    assert pilot.session.view.look_through == 0


def test_cameras_of_any_name_can_be_chosen_from_the_list(pilot: Pilot) -> None:
    names = ("a##b", "c##b", "", "%s%n", *pilot.session.rig.names[4:])
    pilot.session.rig = dataclasses.replace(pilot.session.rig, names=names)
    for index in range(4):
        pilot.click("viewport.camera")
        pilot.draw(2)
        pilot.click(f"viewport.camera{index}")
        pilot.draw(2)
        assert pilot.session.view.look_through == index
    assert len(pilot.session.notices) == 0


def test_tab_shows_all_marks_then_hides_them(pilot: Pilot) -> None:
    overlays = pilot.session.overlays
    pilot.key(key.TAB)
    assert (overlays.show_frusta, overlays.show_inherited, overlays.show_residual) == (True, True, True)
    pilot.key(key.TAB)
    assert (overlays.show_frusta, overlays.show_inherited, overlays.show_residual) == (False, False, False)
    assert {command.name for command in pilot.sent(ToggleOverlay)} == {"show_frusta", "show_inherited", "show_residual"}


def listen_to_tooltips(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What tooltips say from here on."""
    said: list[str] = []
    show = imgui.set_tooltip

    def listen(text: str) -> None:
        said.append(text)
        show(text)

    monkeypatch.setattr("ui.panels.picture.picture_pane.imgui.set_tooltip", listen)
    return said


def test_the_pointer_asks_an_anchor_what_it_is_and_why(pilot: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    said = listen_to_tooltips(monkeypatch)
    pilot.session.clip_states[0] = ClipStatus("trained", 1.0)
    area, view = pilot.rects["viewport.rendered"], pilot.session.view
    K, pose = view.K(round(area.width), round(area.height)), view.world_to_camera()
    x, y, depth = 0.4 * area.width, 0.5 * area.height, 2.0
    point = pose[:3, :3].T @ (depth * np.linalg.inv(K) @ [x, y, 1.0] - pose[:3, 3])
    pilot.session._anchors = AnchorArrays(
        point[None].astype(np.float32),
        np.zeros((0, 3), np.float32),
        key="one anchor",
        inherited_roles=np.array([ROLES.index("promoted")], np.uint8),
        own_roles=np.zeros(0, np.uint8),
        inherited_reasons=np.array([USER_DYNAMIC], np.uint8),
        own_reasons=np.zeros(0, np.uint8),
    )
    pilot.move(area.x0 + x, area.y0 + y)
    pilot.draw(2)
    assert not any("promoted" in text for text in said)  # nothing is shown yet
    pilot.key(key.TAB)
    pilot.draw(2)
    assert any("promoted" in text and "marked as dynamic" in text for text in said)


def test_a_camera_s_pyramid_says_its_name_and_a_click_looks_through_it(
    pilot: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = listen_to_tooltips(monkeypatch)
    session, view = pilot.session, pilot.session.view
    view.dolly(3.0)
    pilot.rest()
    area = pilot.rects["viewport.rendered"]
    K, pose = view.K(round(area.width), round(area.height)), view.world_to_camera()
    lines = frusta_lines(session.rig, frustum_size(session.rig))[0].reshape(8, -1, 2, 3)
    x, y, z = K @ (pose[:3, :3] @ lines[5, 5].mean(axis=0) + pose[:3, 3])
    at = (area.x0 + x / z, area.y0 + y / z)
    pilot.move(*at)
    pilot.draw(2)
    assert "cam05" in said[-1]
    assert pilot.studio.frame.viewport.scene.marks.pointed_camera == 5
    yaw = view.yaw
    pilot.drag(at, (at[0] + 60, at[1]))
    assert view.yaw - yaw == pytest.approx(0.36, abs=1e-6), "a drag that begins there orbits, in full"
    assert pilot.sent(LookThrough) == []
    pilot.drag((at[0] + 60, at[1]), at)
    pilot.tap(*at)
    assert pilot.sent(LookThrough) == [LookThrough(5)]
    assert view.look_through == 5


def test_marks_grow_and_fade_as_the_show_popup_says_and_hidden_ones_are_faint(pilot: Pilot) -> None:
    session = pilot.session
    session.clip_states[0] = ClipStatus("trained", 1.0)
    session.overlays.show_frusta, session.overlays.show_inherited = False, True
    pilot.rest()
    plain = _changed_by_marks(pilot)
    session.overlays.mark_size = 2.0
    pilot.studio.frame.request_redraw()
    larger = _changed_by_marks(pilot)
    assert larger.astype(bool).sum() > 2 * plain.astype(bool).sum()
    session.overlays.mark_size, session.overlays.mark_opacity = 1.0, 0.3
    assert 0 < _changed_by_marks(pilot).max() < 0.6 * plain.max()
    pilot.tap(*pilot.rects["viewport.overlays"].center)
    rect = pilot.rects["show.mark_opacity"]
    pilot.drag(rect.center, (rect.x1 + 40, rect.center[1]))
    assert session.overlays.mark_opacity == 1.0


def _changed_by_marks(pilot: Pilot) -> np.ndarray:
    """How much each pixel of the picture differs from the same without marks. [H, W]"""
    pictures = []
    for is_shown in (True, False):
        pilot.session.overlays.show_inherited = is_shown
        pilot.studio.frame.request_redraw()
        pilot.rest()
        area = pilot.rects["viewport.rendered"]
        x0, y0, x1, y1 = (round(v) for v in (area.x0, area.y0 + 200, area.x1, area.y1 - 60))
        pictures.append(pilot.picture()[y0:y1, x0:x1].astype(int))
    pilot.session.overlays.show_inherited = True
    return np.abs(pictures[0] - pictures[1]).max(axis=2)


def test_escape_closes_neither_the_window_nor_the_loop(pilot: Pilot) -> None:
    closed = []
    pilot.studio.window.push_handlers(on_close=lambda: closed.append(True))
    pilot.key(key.F1)
    assert pilot.studio.frame.ui.is_help_open
    pilot.key(key.ESCAPE)
    assert not pilot.studio.frame.ui.is_help_open
    pilot.key(key.ESCAPE)
    assert closed == []
    assert not pilot.studio.window.has_exit
    assert not pilot.studio.frame.ui.quit_requested


def test_ctrl_key_pressed_and_released_between_two_frames_still_counts(pilot: Pilot) -> None:
    for name, symbol in (("press", CTRL), ("press", key.Q), ("release", key.Q), ("release", CTRL)):
        pilot.studio.window.dispatch_event(f"on_key_{name}", symbol, 0)
    pilot.draw(3)
    assert pilot.studio.frame.ui.quit_requested


def test_typing_a_frame_number_is_no_shortcut(pilot: Pilot) -> None:
    x, y = pilot.rects["timeline.frame"].center
    pilot.move(x, y)
    for _ in range(2):  # a double click selects the number
        pilot.press()
        pilot.release()
    pilot.type("17")
    pilot.key(key.T)
    pilot.key(key.RETURN)
    pilot.draw(2)
    assert pilot.session.timeline.frame_index == 17
    assert pilot.sent(TrainNextClip) == []


def test_dropped_folder_and_dropped_file_open_the_capture(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    assert "welcome.open" in pilot.rects
    inside = tmp_path / "cameras.json"
    inside.write_text("{}")
    pilot.studio.window.dispatch_event("on_file_drop", 5, 5, [str(tmp_path)])
    pilot.studio.window.dispatch_event("on_file_drop", 5, 5, [str(inside)])
    assert pilot.sent(OpenCapture) == 2 * [OpenCapture(tmp_path, is_asking=True)]


def test_path_box_opens_a_typed_folder(
    open_pilot: Callable[..., Pilot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.key(key.O, modifiers=(CTRL,))
    pilot.draw(3)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(str(tmp_path))
    pilot.key(key.RETURN)
    pilot.draw(2)
    assert pilot.sent(OpenCapture) == [OpenCapture(tmp_path, is_asking=True)]


@pytest.mark.parametrize("text", ["", "/" + "x" * 300, "~nobody-has-this-name/x"])
def test_path_box_takes_any_text(
    open_pilot: Callable[..., Pilot], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.studio.frame.dialog.open(tmp_path)
    pilot.draw(3)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.key(key.BACKSPACE)
    pilot.type(text)
    pilot.draw(3)
    pilot.click("open.accept")
    pilot.draw(2)
    assert len(pilot.session.notices) == 0
    assert pilot.sent(OpenCapture) == []


def test_a_panel_that_raises_becomes_one_notice_and_the_others_go_on(
    pilot: Pilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        imgui.begin_child("left open by the failure")
        raise RuntimeError("broken on purpose")

    panels = pilot.studio.frame._panels
    monkeypatch.setattr(
        pilot.studio.frame, "_panels", tuple((title, fail if title == "Training" else f, p) for title, f, p in panels)
    )
    pilot.draw(5)
    assert [(notice.kind, notice.detail) for notice in pilot.session.notices] == [
        ("error", "RuntimeError: broken on purpose")
    ]
    assert "timeline.track" in pilot.rects
    assert "viewport.canvas" in pilot.rects


def test_dismissing_a_notice_takes_its_index(pilot: Pilot) -> None:
    pilot.session.notices.add("error", "Not a capture folder", "It holds no cameras.json.", "Choose another.")
    pilot.session.notices.add("error", "Second")
    pilot.draw(3)
    pilot.click("notice1.close")
    assert pilot.sent(DismissNotice) == [DismissNotice(1)]
    assert [notice.title for notice in pilot.session.notices] == ["Not a capture folder"]


def test_nothing_is_drawn_while_nothing_changes(pilot: Pilot) -> None:
    pilot.rest()
    drawn = [pilot.studio.frame.update(1 / 60) for _ in range(5)]
    assert drawn == [False] * 5
    pilot.studio.window.dispatch_event("on_mouse_motion", 200, 200, 1, 1)
    assert pilot.studio.frame.update(1 / 60)


def test_untrained_frames_show_the_cloud_not_black(pilot: Pilot) -> None:
    pilot.draw(3)
    image = read_window(pilot.studio.ctx, 1280, 800)
    rect = pilot.rects["viewport.canvas"]
    middle = image[int(rect.y0) + 60 : int(rect.y1) - 60, int(rect.x0) + 60 : int(rect.x1) - 60]
    # the made-up cloud is a ball of 6000 coloured points around the pivot; the backdrop is darker than 30
    assert (middle.max(axis=2) > 90).mean() > 0.01


def test_screenshot_is_upright_and_written_whole(pilot: Pilot, tmp_path: Path) -> None:
    from PIL import Image

    pilot.draw(2)
    path = write_png(read_window(pilot.studio.ctx, 1280, 800), tmp_path / "pictures" / "window.png")
    with Image.open(path) as stored:
        image = np.asarray(stored)
    assert image.shape == (800, 1280, 3)
    assert image[-20:, :300].max() > 140, "the status bar's text is at the bottom left"
    assert image[-20:, 300:900].max() < 60, "the status bar is dark as the menu bar is"
    assert image[:4].mean() < 60, "the dark menu bar is at the top"
    assert [entry.name for entry in path.parent.iterdir()] == ["window.png"]


def test_closing_closes_the_session_once(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot()
    pilot.studio.close()
    pilot.studio.close()
    assert pilot.session.is_closed


def _without_cameras(folder: Path) -> str:
    (folder / "cameras.json").unlink()
    return "not a capture"


def _with_half_a_video(folder: Path) -> str:
    video = folder / "cam01.mp4"
    video.write_bytes(video.read_bytes()[: video.stat().st_size * 6 // 10])
    return "cam01"


def _with_nan_in_a_pose(folder: Path) -> str:
    path = folder / "cameras.json"
    document = json.loads(path.read_text())
    document["cameras"][2]["world_to_camera"][0][3] = float("nan")
    path.write_text(json.dumps(document))
    return "has NaN"


@pytest.mark.parametrize("damage", [_without_cameras, _with_half_a_video, _with_nan_in_a_pose])
def test_why_a_capture_cannot_be_opened_is_said_and_the_window_goes_on(
    damage: Callable[[Path], str],
    open_pilot: Callable[..., Pilot],
    tiny_capture: Path,
    tmp_path: Path,
) -> None:
    folder = tmp_path / "holiday"
    shutil.copytree(tiny_capture, folder)
    expected = damage(folder)
    before = sorted(folder.iterdir())
    session = Session(
        project_dir=tmp_path / "project", settings=Settings(tmp_path / "settings.json"), is_preloading=False
    )
    pilot = open_pilot(session)  # closes the session with the window
    pilot.studio.window.dispatch_event("on_file_drop", 10, 10, [str(folder)])
    draw_until(pilot, lambda: session.opening.refused is not None, "why it does not open")
    pilot.draw(3)
    refused = session.opening.refused
    assert refused is not None
    assert expected in refused.text
    assert str(folder) in refused.text
    assert sorted(folder.iterdir()) == before
    assert not (tmp_path / "project").exists()
    pilot.click("refused.close")
    assert session.opening.refused is None
    assert len(session.notices) == 0
    session.dispatch(OpenCapture(tiny_capture))
    draw_until(pilot, lambda: session.capture is not None, "a good capture")
    assert len(session.clips) == 1
