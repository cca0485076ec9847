"""Actions on the keys of the volume that the chosen edit acts on."""

from __future__ import annotations

from typing import Any

from app.session.session_view import SessionView
from engine.editing.edit import KeyedVolume
from ui.panels.actions.action import EDIT, Action, Run
from ui.panels.editing.volume_keys import KeyChange, follow, go_to_key, key_here, object_to_follow, remove_key, unkey
from ui.panels.state import Dispatch, UiState


def _changed(change: KeyChange, why_not: str) -> Run:
    """Send the change of the chosen edit; where there is nothing to change, say why."""

    def run(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        edit = session.edits.edit(ui.editing.chosen)
        command = None if edit is None else change(edit, session.timeline.frame_index)
        if command is None:
            session.notices.add("info", why_not)
        else:
            dispatch(command)

    return run


def _go(step: int) -> Run:
    def go(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        edit = session.edits.edit(ui.editing.chosen)
        if edit is not None and isinstance(edit.target, KeyedVolume):
            go_to_key(session, dispatch, edit.target, step)
        else:
            session.notices.add("info", NO_KEYS)

    return go


def _follow(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    edit = session.edits.edit(ui.editing.chosen)
    one = None if edit is None else object_to_follow(session, ui, edit)
    if edit is not None and one is not None:
        follow(session, dispatch, edit, one)


def _no_object(session: SessionView) -> str:
    return _cannot_edit(session) or ("" if session.edits.objects else "There are no objects yet.")


def _cannot_edit(session: SessionView) -> str:
    return "" if session.edits.can_edit else session.edits.why_not or "Nothing can be edited now."


NO_KEYS = "The volume of the chosen edit has no keys."
MENU = "Edit/Volume"
_EDIT: dict[str, Any] = {"needs_edit": True, "menu": MENU}
ACTIONS = (
    Action(
        "volume.key",
        "Key the volume of the chosen edit at the playhead",
        EDIT,
        _changed(key_here, "The chosen edit does not act on a volume."),
        keys=("Ctrl+Shift+K",),
        lacks=_cannot_edit,
        **_EDIT,
    ),
    Action(
        "volume.remove_key",
        "Remove the key of the volume at the playhead",
        EDIT,
        _changed(remove_key, "The volume has no key at this frame."),
        keys=("Alt+Shift+K",),
        lacks=_cannot_edit,
        **_EDIT,
    ),
    Action(
        "volume.unkey",
        "Remove all keys of the volume: it stays as it is shown",
        EDIT,
        _changed(unkey, NO_KEYS),
        lacks=_cannot_edit,
        **_EDIT,
    ),
    Action(
        "volume.follow",
        "Let the volume of the chosen edit follow the object",
        EDIT,
        _follow,
        lacks=_no_object,
        **_EDIT,
    ),
    *(
        Action(f"volume.{name}_key", f"{name.capitalize()} key of the volume", EDIT, _go(step), (key,), **_EDIT)
        for name, step, key in (("previous", -1, "Alt+Shift+,"), ("next", 1, "Alt+Shift+."))
    ),
)
