"""The lane of the camera: the keys of the chosen camera path as diamonds. Pressed they are chosen, dragged they move in
time, and a double click goes there.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.paths.path_commands import ChooseCameraKey, TimeCameraKey
from app.session.session_view import SessionView
from ui.panels.pieces.key_words import key_words
from ui.panels.state import Dispatch
from ui.panels.timeline.key_lanes.diamonds import DRAG_FROM, draw_diamonds, nearest_diamond
from ui.panels.timeline.rows.rows import CAMERA
from ui.panels.timeline.rows.stage import TimelineStage
from ui.style import theme


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
    frames = [key.frame for key in path.keys]
    draw_diamonds(stage, frames, row, "timeline.key", color, chosen=status.chosen_key)
    pointed = key_at(stage, session)
    if pointed is not None and stage.ui.paths.timed is None:
        imgui.begin_tooltip()
        imgui.text_unformatted(key_words(status, pointed))
        imgui.text_disabled("Drag to move it in time; double-click to go there")
        imgui.end_tooltip()


def key_at(stage: TimelineStage, session: SessionView) -> int | None:
    """Number of the key under the pointer."""
    path = session.paths.path
    if path is None or stage.pointer is None or not stage.is_pointed_at(CAMERA):
        return None
    return nearest_diamond(stage, [key.frame for key in path.keys], stage.pointer[0])


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
