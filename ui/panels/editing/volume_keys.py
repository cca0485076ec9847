"""Keys of the volume that an edit acts on: what buttons and actions do to them, and the buttons."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui
from msgspec import structs

from app.session.editing.edit_commands import ChangeEdit
from app.session.objects.follow_commands import FollowObject
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from engine.editing.edit import Edit, KeyedVolume, ObjectTarget
from engine.editing.scene_object import SceneObject
from engine.editing.volumes.keyed_volume import key_at, volume_of, with_key, without_key
from engine.text import one_line
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon

KeyChange = Callable[[Edit, int], "ChangeEdit | None"]
"""From the edit and the shown frame; None where there is nothing to change."""


def key_here(edit: Edit, frame_index: int) -> ChangeEdit | None:
    """Give the volume a key at the shown frame, as it is there."""
    volume = volume_of(edit.target, frame_index)
    if volume is None:
        return None
    target = edit.target if isinstance(edit.target, KeyedVolume) else volume
    return ChangeEdit(structs.replace(edit, target=with_key(target, frame_index, volume)), verb="key the volume")


def remove_key(edit: Edit, frame_index: int) -> ChangeEdit | None:
    """Take the key at the shown frame away."""
    number = key_at(edit.target, frame_index) if isinstance(edit.target, KeyedVolume) else None
    if number is None or not isinstance(edit.target, KeyedVolume):
        return None
    return ChangeEdit(structs.replace(edit, target=without_key(edit.target, number)), verb="remove key")


def unkey(edit: Edit, frame_index: int) -> ChangeEdit | None:
    """Take all keys away: the volume rests as it is shown."""
    if not isinstance(edit.target, KeyedVolume):
        return None
    return ChangeEdit(structs.replace(edit, target=volume_of(edit.target, frame_index)), verb="remove all keys")


def go_to_key(session: SessionView, dispatch: Dispatch, keyed: KeyedVolume, step: int) -> None:
    """Show the frame of the key before or after the shown one; the first or the last one where there is none."""
    frames, now = [round(key.frame) for key in keyed.keys], session.timeline.frame_index
    if step > 0:
        wanted = next((frame for frame in frames if frame > now), frames[-1])
    else:
        wanted = next((frame for frame in reversed(frames) if frame < now), frames[0])
    dispatch(SetFrame(session.timeline.clamped(wanted)))


def object_to_follow(session: SessionView, ui: UiState, edit: Edit) -> SceneObject | None:
    """The chosen object, else the one that the edit acts on, else the first one; None without objects."""
    target = edit.target
    own = session.edits.object(target.object_id) if isinstance(target, ObjectTarget) else None
    return session.edits.object(ui.objects.chosen) or own or next(iter(session.edits.objects), None)


def follow(session: SessionView, dispatch: Dispatch, edit: Edit, one: SceneObject) -> None:
    """Let the volume of an edit go along with an object."""
    dispatch(FollowObject(one.object_id, edit.edit_id))


def draw_volume_keys(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    """The keys in words, and a button for each thing that can be done to them; without keys one to begin with, next to
    what was drawn before."""
    frame_index, keyed = session.timeline.frame_index, edit.target
    if not isinstance(keyed, KeyedVolume):
        _same_line_for("Key here")
        _button(dispatch, ui, "Key here", "volume.key", key_here(edit, frame_index))
        imgui.set_item_tooltip("Lets the volume move: it gets a key at this frame (Ctrl+Shift+K)")
        _draw_follow(session, dispatch, ui, edit)
        return
    n_keys = len(keyed.keys)
    text_wrapped_dim(
        f"{n_keys} key{'' if n_keys == 1 else 's'}, frames {keyed.keys[0].frame:g} to {keyed.keys[-1].frame:g};"
        " a change sets the key of the shown frame."
    )
    for icon, name, step in ((Icon.STEP_BACK, "previous", -1), (Icon.STEP_FORWARD, "next", 1)):
        if imgui.button(f"{icon}##{name} key"):
            go_to_key(session, dispatch, keyed, step)
        ui.mark(f"volume.{name}_key")
        imgui.set_item_tooltip(f"{name.capitalize()} key")
        imgui.same_line()
    is_key = key_at(keyed, frame_index) is not None
    if is_key:
        _button(dispatch, ui, "Remove key", "volume.remove_key", remove_key(edit, frame_index))
    else:
        _button(dispatch, ui, "Key here", "volume.key", key_here(edit, frame_index))
    imgui.same_line()
    _button(dispatch, ui, "Unkey", "volume.unkey", unkey(edit, frame_index))
    imgui.set_item_tooltip("Removes all keys: the volume stays as it is in this frame")
    _draw_follow(session, dispatch, ui, edit)


def _draw_follow(session: SessionView, dispatch: Dispatch, ui: UiState, edit: Edit) -> None:
    one = object_to_follow(session, ui, edit)
    if one is None:
        return
    _same_line_for("Follow")
    if imgui.button("Follow"):
        follow(session, dispatch, edit, one)
    ui.mark("volume.follow")
    imgui.set_item_tooltip(f"Sets keys so that the volume goes along with {one_line(one.name)}")


def _same_line_for(label: str) -> None:
    """Go on in the same line where a button fits in."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < imgui.calc_text_size(label).x + 2 * imgui.get_style().frame_padding.x:
        imgui.new_line()


def _button(dispatch: Dispatch, ui: UiState, label: str, name: str, command: ChangeEdit | None) -> None:
    if imgui.button(label) and command is not None:
        dispatch(command)
    ui.mark(name)
