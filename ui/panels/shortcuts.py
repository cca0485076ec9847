"""One table: key -> action -> help text. The F1 sheet and the key handling read the same rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from imgui_bundle import imgui

from app.playback.orbit_view import OrbitView
from app.playback.timeline import Timeline
from app.session.commands import (
    HomeView,
    LookThrough,
    PauseTraining,
    RedoMark,
    RemoveRegion,
    ResumeTraining,
    SetCompare,
    SetFrame,
    StopTraining,
    ToggleOverlay,
    TogglePlay,
    TrainNextClip,
    UndoMark,
)
from app.status import COMPARE_MODES, Overlays, TrainingStatus, WantedFrame
from engine.camera.projection import camera_center
from engine.camera.rig import CameraRig
from ui.panels.regions import RegionsNeeds, begin_choosing
from ui.panels.state import REGIONS, TRAINING, Dispatch, UiState
from ui.style.ui_scale import next_choice
from ui.viewport.region_tool import GROWTH

Action = Callable[["ShortcutNeeds", Dispatch, UiState], None]

MARK_NAMES = ("show_frusta", "show_inherited", "show_residual")
"""The overlays that Tab shows or hides together."""


class ShortcutNeeds(RegionsNeeds, Protocol):
    """What keys act on."""

    @property
    def timeline(self) -> Timeline: ...

    @property
    def view(self) -> OrbitView: ...

    @property
    def overlays(self) -> Overlays: ...

    @property
    def rig(self) -> CameraRig: ...

    @property
    def training(self) -> TrainingStatus: ...

    def wanted_frame(self) -> WantedFrame | None: ...


@dataclass(frozen=True)
class Shortcut:
    """One row: a key with exact modifiers, what it does, and how the help sheet says it.

    Attributes:
        key_name: Attribute of imgui.Key, for example "space".
        label: The key as printed.
        needs_capture: Ignored until a capture is open.
        needs_choosing: Ignored unless a region is being chosen.
        repeats: Holding the key repeats the action.
        is_any_shift: With Shift or without, for signs that need it on some keyboards.
        is_listed: In menus; a second key of an entry is not.
        is_on: Of what can be on or off, whether it is; menus show a tick.
    """

    key_name: str
    label: str
    text: str
    group: str
    action: Action
    is_ctrl: bool = False
    is_shift: bool = False
    needs_capture: bool = True
    needs_choosing: bool = False
    repeats: bool = False
    is_any_shift: bool = False
    is_on: Callable[[ShortcutNeeds], bool] | None = None
    is_listed: bool = True

    @property
    def key(self) -> imgui.Key:
        """The ImGui key."""
        return getattr(imgui.Key, self.key_name)


# ---- actions ---------------------------------------------------------------------------------------------------


def go_to_frame(timeline: Timeline, dispatch: Dispatch, frame_index: int) -> None:
    """Move the playhead, held inside the capture."""
    dispatch(SetFrame(int(np.clip(frame_index, 0, timeline.last_frame))))


def _step_by(n: int) -> Action:
    def step(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + n)

    return step


def _step_second(sign: int) -> Action:
    def step(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        n = max(1, round(session.timeline.fps))
        go_to_frame(session.timeline, dispatch, session.timeline.frame_index + sign * n)

    return step


def _first_frame(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, 0)


def _last_frame(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.n_frames - 1)


def _previous_clip(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.previous_clip_start(session.timeline.frame_index))


def _next_clip(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    go_to_frame(session.timeline, dispatch, session.timeline.next_clip_start(session.timeline.frame_index))


def _toggle_play(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(TogglePlay())


def _toggle_every_frame(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_every_frame = not session.timeline.is_every_frame


def _toggle_loop(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    session.timeline.is_looping = not session.timeline.is_looping


def _camera_by(step: int) -> Action:
    def hop(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        n_cameras = len(session.rig)
        shown = session.view.look_through
        if shown is None:
            dispatch(LookThrough(nearest_camera(session)))
        else:
            dispatch(LookThrough((shown + step) % n_cameras))

    return hop


def _home(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(HomeView())


def nearest_camera(session: ShortcutNeeds) -> int:
    """The capture camera that looks most like the current view: near in place and direction."""
    rig = session.rig
    world_to_camera = np.asarray(session.view.world_to_camera(), dtype=np.float64)
    distances = np.linalg.norm(rig.centers - camera_center(world_to_camera), axis=1)
    spread = max(float(np.linalg.norm(rig.centers - rig.centers.mean(0), axis=1).max()), 1e-9)
    turns = 1.0 - rig.forwards @ world_to_camera[2, :3]
    return int(np.argmin(distances / spread + turns))


def set_compare(session: ShortcutNeeds, dispatch: Dispatch, mode: str) -> None:
    """Compare with the captured picture; needs a capture camera, so the nearest one is taken from a free view."""
    if mode != "off" and session.view.look_through is None:
        dispatch(LookThrough(nearest_camera(session)))
    dispatch(SetCompare(mode))


def shown_compare(session: ShortcutNeeds) -> str:
    """The comparison on screen: none from a free view, where no camera took a picture."""
    return "off" if session.view.look_through is None else session.overlays.compare


def _cycle_compare(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    shown = COMPARE_MODES.index(shown_compare(session))
    set_compare(session, dispatch, COMPARE_MODES[(shown + 1) % len(COMPARE_MODES)])


def _is_shown(name: str) -> Callable[[Any], bool]:
    return lambda session: bool(getattr(session.overlays, name))


def _are_marks_shown(session: ShortcutNeeds) -> bool:
    return all(getattr(session.overlays, name) for name in MARK_NAMES)


def _toggle_overlays(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    is_all_shown = _are_marks_shown(session)
    for name in MARK_NAMES:
        if getattr(session.overlays, name) == is_all_shown:
            dispatch(ToggleOverlay(name))


def _toggle_overlay(name: str) -> Action:
    def toggle(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(ToggleOverlay(name))

    return toggle


def cloud_overlay(session: ShortcutNeeds) -> str:
    """The overlay that shows or hides the point cloud: in place of a trained picture, or where there is none."""
    wanted = session.wanted_frame()
    return "show_points" if wanted is None or not wanted.revision else "show_cloud"


def _is_cloud_shown(session: ShortcutNeeds) -> bool:
    return bool(getattr(session.overlays, cloud_overlay(session)))


def _toggle_cloud(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(ToggleOverlay(cloud_overlay(session)))


def train_or_pause(session: ShortcutNeeds, dispatch: Dispatch) -> None:
    """One key for the whole loop: start the next clip, pause what runs, resume what is paused."""
    status = session.training
    if status.state in ("starting", "preparing", "running"):
        dispatch(PauseTraining())
    elif status.state == "paused":
        dispatch(ResumeTraining())
    elif status.can_train_next:
        dispatch(TrainNextClip())


def _train(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    train_or_pause(session, dispatch)


def _stop_training(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.training.state not in ("idle", "failed", "stopping"):
        dispatch(StopTraining())


def _toggle_quality(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_quality_open = not ui.is_quality_open
    if ui.is_quality_open:
        ui.wanted_panel = TRAINING


def _choose_region(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    begin_choosing(session, ui)


def _mark_chosen(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.regions.is_accepted = True  # the viewport marks it, once it knows where the pointer is


def _leave_choosing(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.regions.leave()


def _grow_by(factor: float) -> Action:
    def grow(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.set_radius(ui.regions.radius * factor)

    return grow


def _shift_by(right: float, down: float, forward: float) -> Action:
    def shift(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.shift(session.view.world_to_camera(), right, down, forward)

    return shift


def _next_region(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.wanted_panel = REGIONS
    ui.regions.highlight_next(len(session.regions.regions))


def _remove_region(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if ui.regions.highlighted is not None and session.regions.can_mark:
        dispatch(RemoveRegion(ui.regions.highlighted))


def _undo_mark(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.regions.can_undo:
        dispatch(UndoMark())


def choose_scale(ui: UiState, scale: float | None) -> None:
    """Draw the interface at another size from the next frame on; None follows the screen."""
    ui.scale.chosen = scale
    ui.redraw_within(0.0)


def _scale_by(step: int) -> Action:
    def change(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
        choose_scale(ui, next_choice(ui.scale.wanted, step))

    return change


def _reset_scale(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    choose_scale(ui, None)


def _menu(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_menu_wanted = True


def _redo_mark(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.regions.can_redo:
        dispatch(RedoMark())


def _help(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_help_open = not ui.is_help_open


def _open(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_open_requested = True


def _quit(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.quit_requested = True


TIME, VIEW, COMPARE, MARK, TRAIN, WINDOW = "Time", "View", "Show and compare", "Mark regions", "Train", "Window"

_STEERING: dict[str, Any] = {"needs_choosing": True, "repeats": True}
_SCALING: dict[str, Any] = {"is_ctrl": True, "is_any_shift": True, "needs_capture": False}


SHORTCUTS: tuple[Shortcut, ...] = (
    Shortcut("space", "Space", "Play or pause", TIME, _toggle_play),
    Shortcut("left_arrow", "Left", "One frame back", TIME, _step_by(-1), repeats=True),
    Shortcut("right_arrow", "Right", "One frame forward", TIME, _step_by(1), repeats=True),
    Shortcut("left_arrow", "Shift+Left", "One second back", TIME, _step_second(-1), is_shift=True, repeats=True),
    Shortcut("right_arrow", "Shift+Right", "One second forward", TIME, _step_second(1), is_shift=True, repeats=True),
    Shortcut("home", "Home", "First frame", TIME, _first_frame),
    Shortcut("end", "End", "Last frame", TIME, _last_frame),
    Shortcut("up_arrow", "Up", "Start of this or the previous clip", TIME, _previous_clip, repeats=True),
    Shortcut("down_arrow", "Down", "Start of the next clip", TIME, _next_clip, repeats=True),
    Shortcut("l", "L", "Loop on or off", TIME, _toggle_loop, is_on=lambda session: session.timeline.is_looping),
    Shortcut(
        "e",
        "E",
        "Play every frame, or skip frames to keep the speed",
        TIME,
        _toggle_every_frame,
        is_on=lambda session: session.timeline.is_every_frame,
    ),
    Shortcut("f", "F", "Frame the whole scene", VIEW, _home),
    Shortcut("left_bracket", "[", "Look through the previous camera", VIEW, _camera_by(-1), repeats=True),
    Shortcut("right_bracket", "]", "Look through the next camera", VIEW, _camera_by(1), repeats=True),
    Shortcut("g", "G", "Compare with the captured picture: wipe, side by side, off", COMPARE, _cycle_compare),
    Shortcut("tab", "Tab", "Show or hide cameras and anchors", COMPARE, _toggle_overlays, is_on=_are_marks_shown),
    Shortcut(
        "_1", "1", "Show or hide cameras", COMPARE, _toggle_overlay("show_frusta"), is_on=_is_shown("show_frusta")
    ),
    Shortcut(
        "_2",
        "2",
        "Show or hide inherited anchors",
        COMPARE,
        _toggle_overlay("show_inherited"),
        is_on=_is_shown("show_inherited"),
    ),
    Shortcut(
        "_3",
        "3",
        "Show or hide residual anchors",
        COMPARE,
        _toggle_overlay("show_residual"),
        is_on=_is_shown("show_residual"),
    ),
    Shortcut(
        "_4", "4", "Point cloud, also in place of a trained picture", COMPARE, _toggle_cloud, is_on=_is_cloud_shown
    ),
    Shortcut(
        "_5",
        "5",
        "Show or hide marked regions",
        COMPARE,
        _toggle_overlay("show_regions"),
        is_on=_is_shown("show_regions"),
    ),
    Shortcut("_6", "6", "Quality over clips, in the training panel", COMPARE, _toggle_quality),
    Shortcut("m", "M", "Mark a sphere as static or moving; again to switch", MARK, _choose_region),
    Shortcut("enter", "Enter", "Mark the chosen sphere", MARK, _mark_chosen, needs_choosing=True),
    Shortcut("escape", "Escape", "Leave without marking", MARK, _leave_choosing, needs_choosing=True),
    Shortcut("minus", "-", "Smaller sphere", MARK, _grow_by(1 / GROWTH), **_STEERING, is_any_shift=True),
    Shortcut("equal", "+", "Larger sphere", MARK, _grow_by(GROWTH), **_STEERING, is_any_shift=True),
    Shortcut("left_arrow", "Ctrl+Left", "Sphere to the left", MARK, _shift_by(-1, 0, 0), **_STEERING, is_ctrl=True),
    Shortcut("right_arrow", "Ctrl+Right", "Sphere to the right", MARK, _shift_by(1, 0, 0), **_STEERING, is_ctrl=True),
    Shortcut("up_arrow", "Ctrl+Up", "Sphere up", MARK, _shift_by(0, -1, 0), **_STEERING, is_ctrl=True),
    Shortcut("down_arrow", "Ctrl+Down", "Sphere down", MARK, _shift_by(0, 1, 0), **_STEERING, is_ctrl=True),
    Shortcut("page_up", "Page Up", "Sphere farther away", MARK, _shift_by(0, 0, 1), **_STEERING),
    Shortcut("page_down", "Page Down", "Sphere nearer", MARK, _shift_by(0, 0, -1), **_STEERING),
    Shortcut("n", "N", "Highlight the next marked region", MARK, _next_region),
    Shortcut("delete", "Delete", "Remove the highlighted region", MARK, _remove_region),
    Shortcut("z", "Ctrl+Z", "Take back the last mark or removal", MARK, _undo_mark, is_ctrl=True),
    Shortcut("z", "Ctrl+Shift+Z", "Do again what was taken back", MARK, _redo_mark, is_ctrl=True, is_shift=True),
    Shortcut("y", "Ctrl+Y", "Do again what was taken back", MARK, _redo_mark, is_ctrl=True, is_listed=False),
    Shortcut("t", "T", "Train the next clip, pause or resume", TRAIN, _train),
    Shortcut("t", "Ctrl+T", "Stop training and keep what was learned", TRAIN, _stop_training, is_ctrl=True),
    Shortcut("o", "Ctrl+O", "Open a capture or project folder", WINDOW, _open, is_ctrl=True, needs_capture=False),
    Shortcut("equal", "Ctrl++", "Larger interface", WINDOW, _scale_by(1), **_SCALING),
    Shortcut("minus", "Ctrl+-", "Smaller interface", WINDOW, _scale_by(-1), **_SCALING),
    Shortcut("_0", "Ctrl+0", "Interface at the screen's own size", WINDOW, _reset_scale, **_SCALING),
    Shortcut("f10", "F10", "Menus (also Alt); arrow keys work in them", WINDOW, _menu, needs_capture=False),
    Shortcut("f1", "F1", "This sheet", WINDOW, _help, needs_capture=False),
    Shortcut("q", "Ctrl+Q", "Quit; what was learned is kept", WINDOW, _quit, is_ctrl=True, needs_capture=False),
)

MOUSE_HELP: tuple[tuple[str, str], ...] = (
    ("Left drag", "Orbit around the pivot"),
    ("Right drag", "Move the view sideways (also Shift + middle drag)"),
    ("Wheel", "Move nearer or farther (also Ctrl + middle drag)"),
    ("Click, wheel", "While a region is chosen: fix its place, change its size (Ctrl + wheel moves the view)"),
    ("Camera click", "Look through the camera whose pyramid it is"),
    ("Timeline drag", "Move through time"),
    ("White line drag", "Wipe between render and captured picture"),
    ("Folder drop", "Open it: a capture or a project"),
)


def handle_shortcuts(session: ShortcutNeeds, dispatch: Dispatch, ui: UiState) -> None:
    """Run the actions of keys pressed since the last frame. Text fields keep their keys."""
    io = imgui.get_io()
    if ui.is_help_open and imgui.is_key_pressed(imgui.Key.escape, False):
        ui.is_help_open = False
        return
    if io.want_text_input or ui.is_popup_open:  # the key that closes a menu does nothing else
        return
    for shortcut in SHORTCUTS:
        is_shift_right = shortcut.is_any_shift or shortcut.is_shift == io.key_shift
        if shortcut.is_ctrl != io.key_ctrl or not is_shift_right or io.key_alt:
            continue
        if not imgui.is_key_pressed(shortcut.key, shortcut.repeats):
            continue
        if shortcut.needs_capture and session.capture is None:
            continue
        if shortcut.needs_choosing and not ui.regions.is_active:
            continue
        shortcut.action(session, dispatch, ui)
