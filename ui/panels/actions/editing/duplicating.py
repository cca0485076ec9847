"""Actions on copies of objects."""

from __future__ import annotations

from collections.abc import Callable

from app.session.duplicating.copy_commands import RemoveCopies
from app.session.session_view import SessionView
from engine.editing.scene_object import SceneObject
from ui.panels.actions.action import EDIT, Action, Run
from ui.panels.editing.copies.making_copies import duplicate, give_speed, make_crowd
from ui.panels.state import Dispatch, UiState


def _of_object(make: Callable[[SessionView, Dispatch, UiState, SceneObject], None]) -> Run:
    def run(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        found = ui.copies.object(session.edits)
        if found is not None:
            ui.show_edit("copies")
            make(session, dispatch, ui, found)

    return run


def _remove_all(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(RemoveCopies(tuple(copy.copy_id for copy in session.edits.copies)))


def _no_object(session: SessionView) -> str:
    if not session.edits.can_edit:
        return session.edits.why_not or "Objects cannot be copied now."
    return "" if session.edits.objects else "There is no object yet."


def _no_copy(session: SessionView) -> str:
    if not session.edits.can_edit:
        return session.edits.why_not or "Copies cannot be removed now."
    return "" if session.edits.copies else "There are no copies."


ACTIONS = (
    Action(
        "copies.duplicate",
        "Duplicate the object",
        EDIT,
        _of_object(duplicate),
        keys=("Ctrl+Shift+D",),
        lacks=_no_object,
    ),
    Action("copies.speed", "Play the object at its own speed", EDIT, _of_object(give_speed), lacks=_no_object),
    Action("copies.crowd", "Make a crowd of the object", EDIT, _of_object(make_crowd), lacks=_no_object),
    Action("copies.clear", "Remove all copies of objects", EDIT, _remove_all, lacks=_no_copy),
)
