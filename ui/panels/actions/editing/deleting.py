"""Delete, undo and redo: the keys that act on whatever is meant. All that Delete can mean stands in `_delete`."""

from __future__ import annotations

from app.session.editing.edit_commands import Redo, RemoveEdit, Undo
from app.session.editing.mark_commands import RemoveRegion
from app.session.paths.path_commands import DeleteCameraKey
from app.session.session_view import SessionView
from ui.panels.actions.action import MARK, Action
from ui.panels.editing.edit_subject import meant
from ui.panels.editing.panel.making import DELETE, make_edit
from ui.panels.state import Dispatch, UiState


def _delete(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The highlighted region; without one, the selection or the drawn volume; else the chosen camera key or edit."""
    region, key, edit = ui.regions.highlighted, session.paths.chosen_key, ui.editing.chosen
    if region is not None:
        if session.regions.can_mark:
            dispatch(RemoveRegion(region))
    elif meant(session, ui)[1]:
        if session.edits.can_edit:
            make_edit(session, dispatch, ui, DELETE)
    elif key is not None and session.paths.can_edit:
        dispatch(DeleteCameraKey(key))
    elif edit is not None and session.edits.can_edit:
        dispatch(RemoveEdit(edit))


def _cannot_delete(session: SessionView) -> str:
    if session.regions.can_mark or session.paths.can_edit or session.edits.can_edit:
        return ""
    return session.regions.why_not or "Regions cannot be removed now."


def _undo(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.history.undo:
        dispatch(Undo())


def _redo(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.history.redo:
        dispatch(Redo())


ACTIONS = (
    Action(
        "mark.remove",
        "Delete what is selected, drawn, highlighted or chosen",
        MARK,
        _delete,
        keys=("Delete",),
        lacks=_cannot_delete,
    ),
    Action(
        "mark.undo",
        "Undo the last step",
        MARK,
        _undo,
        keys=("Ctrl+Z",),
        menu="Edit",
        lacks=lambda session: "" if session.history.undo else "Nothing to undo.",
    ),
    Action(
        "mark.redo",
        "Redo the step undone last",
        MARK,
        _redo,
        keys=("Ctrl+Shift+Z", "Ctrl+Y"),
        menu="Edit",
        lacks=lambda session: "" if session.history.redo else "Nothing to redo.",
    ),
)
