"""The lane of volumes: the keys of the volume that the chosen edit acts on, as diamonds. Pressed, the playhead goes
there; dragged, they move in time.
"""

from __future__ import annotations

from imgui_bundle import imgui
from msgspec import structs

from app.session.editing.edit_commands import ChangeEdit
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from engine.editing.edit import Edit, KeyedVolume
from engine.editing.volumes.keyed_volume import key_at, timed
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.key_lanes.diamonds import DRAG_FROM, draw_diamonds, nearest_diamond
from ui.panels.timeline.rows.rows import VOLUMES
from ui.panels.timeline.rows.stage import TimelineStage
from ui.style import theme


def keyed_edit(session: SessionView, ui: UiState) -> tuple[Edit, KeyedVolume] | None:
    """The chosen edit, with the keyed volume it acts on; None where it has none."""
    edit = session.edits.edit(ui.editing.chosen)
    return (edit, edit.target) if edit is not None and isinstance(edit.target, KeyedVolume) else None


def draw_volume_lane(stage: TimelineStage, session: SessionView) -> None:
    """A line from the first to the last key, and a diamond per key; that at the playhead stands out."""
    found = keyed_edit(session, stage.ui)
    if found is None:
        return
    row, scale, frames = stage.rows[VOLUMES], stage.scale, _frames(found[1])
    first, last = (min(max(scale.middle_of(frame), scale.x0), scale.x1) for frame in (frames[0], frames[-1]))
    stage.draw.add_line_h(first, last, (row.y0 + row.y1) / 2, theme.u32(theme.SKY), 2)
    here = key_at(found[1], session.timeline.frame_index)
    draw_diamonds(stage, frames, row, "timeline.volume_key", theme.SKY, chosen=here)
    pointed = _pointed(stage, found[1])
    if pointed is not None and stage.ui.editing.timed is None:
        imgui.set_tooltip(f"Key of the volume at frame {frames[pointed]:g}\nDrag to move it in time")


def handle_keys_of_volume(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> bool:
    """For the item drawn last, the track: whether the pointer has to do with a key, and with nothing else."""
    tool, found = stage.ui.editing, keyed_edit(session, stage.ui)
    x = imgui.get_io().mouse_pos.x
    if imgui.is_item_activated():
        tool.timed = None if found is None else _pointed(stage, found[1])
        if found is not None and tool.timed is not None:
            tool.begin_gesture()
            tool.timed_from = x
            dispatch(SetFrame(session.timeline.clamped(round(found[1].keys[tool.timed].frame))))
            return True
    # A quick drag's last stretch arrives in the same frame as the release, when the item is active no more.
    is_held = imgui.is_item_active() or imgui.is_item_deactivated()
    if tool.timed is None or not is_held or found is None or tool.timed >= len(found[1].keys):
        tool.timed = None
        return False
    if tool.timed_from is not None and abs(x - tool.timed_from) >= DRAG_FROM:
        tool.timed_from = None
    if tool.timed_from is None and session.edits.can_edit:
        _move(session, dispatch, stage.ui, found, session.timeline.clamped(stage.scale.frame_at(x)))
    return True


def _move(
    session: SessionView, dispatch: Dispatch, ui: UiState, found: tuple[Edit, KeyedVolume], frame_index: int
) -> None:
    edit, keyed = found
    assert ui.editing.timed is not None
    moved = timed(keyed, ui.editing.timed, frame_index)
    if moved != keyed:
        dispatch(ChangeEdit(structs.replace(edit, target=moved), ui.editing.gesture, "move key"))
        dispatch(SetFrame(session.timeline.clamped(round(moved.keys[ui.editing.timed].frame))))


def _pointed(stage: TimelineStage, keyed: KeyedVolume) -> int | None:
    if stage.pointer is None or not stage.is_pointed_at(VOLUMES):
        return None
    return nearest_diamond(stage, _frames(keyed), stage.pointer[0])


def _frames(keyed: KeyedVolume) -> list[float]:
    return [key.frame for key in keyed.keys]
