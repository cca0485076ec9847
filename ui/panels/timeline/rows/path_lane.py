"""The lane of the camera: the keys of the chosen camera path as diamonds. Pressed they are chosen, dragged they move in
time, and a double click goes there.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.session.paths.path_commands import ChooseCameraKey, TimeCameraKey
from app.session.session_view import SessionView
from engine.camera.camera_path import CameraPath
from ui.panels.pieces.key_words import key_words
from ui.panels.state import Dispatch, Rect
from ui.panels.timeline.rows.rows import CAMERA
from ui.panels.timeline.rows.stage import TimelineStage
from ui.style import theme

HALF, CHOSEN_HALF = 5.0, 6.5
MIN_KEY_DISTANCE = 3.0
"""Keys closer to each other than this are drawn as one."""
DRAG_FROM = 3.0
"""A press that moves less than this chooses a key and leaves it where it is."""
EASY = 2.0
"""By how much a diamond is easier to hit than it looks."""


def draw_path_lane(stage: TimelineStage, session: SessionView) -> None:
    """A line from the first to the last key, a diamond per key; a loop continues, fainter, till it is back."""
    status, row, scale = session.paths, stage.rows[CAMERA], stage.scale
    path = status.path
    if path is None or not path.keys:
        return
    y = (row.y0 + row.y1) / 2
    first, stop = (min(max(scale.middle_of(frame), scale.x0), scale.x1) for frame in path.frame_range)
    last = min(max(scale.middle_of(path.keys[-1].frame), scale.x0), scale.x1)
    color = theme.GREEN
    stage.draw.add_line_h(first, last, y, theme.u32(color), 2)
    if stop > last:
        stage.draw.add_line_h(last, stop, y, theme.u32(theme.faded(color, 0.4)), 2)
    x_before = -1e9
    for index in keys_in_sight(stage, path):
        x = scale.middle_of(path.keys[index].frame)
        is_chosen = index == status.chosen_key
        if x - x_before < MIN_KEY_DISTANCE and not is_chosen:
            continue
        x_before = x
        _draw_key(stage, index, x, y, is_chosen=is_chosen)
    pointed = key_at(stage, session)
    if pointed is not None and stage.ui.paths.timed is None:
        imgui.begin_tooltip()
        imgui.text_unformatted(key_words(status, pointed))
        imgui.text_disabled("Drag to move it in time; double-click to go there")
        imgui.end_tooltip()


def _draw_key(stage: TimelineStage, index: int, x: float, y: float, *, is_chosen: bool) -> None:
    half = CHOSEN_HALF if is_chosen else HALF
    corners = ImVec2(x, y - half), ImVec2(x + half, y), ImVec2(x, y + half), ImVec2(x - half, y)
    stage.draw.add_quad_filled(*corners, theme.u32(theme.YELLOW if is_chosen else theme.GREEN))
    if is_chosen:
        stage.draw.add_quad(*corners, theme.u32(theme.TEXT), 1.5)
    stage.ui.mark_rect(f"timeline.key{index}", Rect(x - half, y - half, x + half, y + half))


def keys_in_sight(stage: TimelineStage, path: CameraPath) -> range:
    """Numbers of the keys within the shown part."""
    frames = np.array([key.frame for key in path.keys])
    shown = stage.scale.shown
    first, stop = np.searchsorted(frames, [shown.start - 0.5, shown.stop + 0.5])
    return range(int(first), int(stop))


def key_at(stage: TimelineStage, session: SessionView) -> int | None:
    """Number of the key under the pointer."""
    path = session.paths.path
    if path is None or stage.pointer is None or not stage.is_pointed_at(CAMERA):
        return None
    x = stage.pointer[0]
    away = [(abs(stage.scale.middle_of(path.keys[index].frame) - x), index) for index in keys_in_sight(stage, path)]
    distance, nearest = min(away, default=(np.inf, -1))
    return nearest if distance <= CHOSEN_HALF + EASY else None


def handle_keys_of_path(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> bool:
    """For the item drawn last, the track: whether the pointer has to do with a key, and with nothing else."""
    tool, status = stage.ui.paths, session.paths
    if imgui.is_item_activated():
        tool.timed = key_at(stage, session)
        if tool.timed is not None:
            tool.begin_gesture()
            tool.timed_from = imgui.get_io().mouse_pos.x
            stage.ui.regions.highlighted = None
            dispatch(ChooseCameraKey(tool.timed, is_going=imgui.is_mouse_double_clicked(imgui.MouseButton_.left)))
            return True
    # A quick drag's last stretch arrives in the same frame as the release, when the item is active no more.
    is_held = imgui.is_item_active() or imgui.is_item_deactivated()
    if tool.timed is None or not is_held:
        tool.timed = None
        return False
    path, x = status.path, imgui.get_io().mouse_pos.x
    if tool.timed_from is not None and abs(x - tool.timed_from) >= DRAG_FROM:
        tool.timed_from = None
    if path is not None and tool.timed < len(path.keys) and status.can_edit and tool.timed_from is None:
        frame = stage.scale.position_at(x) - 0.5
        if round(frame) != path.keys[tool.timed].frame:
            dispatch(TimeCameraKey(tool.timed, frame, tool.gesture))
    return True
