"""Actions on objects: made and corrected from the selection, chosen, outlined."""

from __future__ import annotations

from collections.abc import Callable

from app.session.objects.object_commands import CorrectObject, FindObject, ObjectCommand, SelectObject
from app.session.session_view import SessionView
from ui.panels.actions.action import EDIT, SELECT, Action, Run
from ui.panels.editing.panel.objects import make_object
from ui.panels.state import Dispatch, UiState


def _make(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    make_object(session, dispatch, ui)
    ui.show_edit("objects")


def _of_chosen(make: Callable[[int], ObjectCommand]) -> Run:
    """Send a command for the chosen object; for the only one where none is chosen."""

    def send(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        objects = session.edits.objects
        if ui.objects.chosen is None and len(objects) == 1:
            ui.objects.choose(objects[0].object_id)
        if ui.objects.chosen is None:
            ui.show_edit("objects")  # where one can be chosen
        else:
            dispatch(make(ui.objects.chosen))

    return send


def _next(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.objects.choose_by(1, session.edits.objects)


def _outline(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.objects.has_all_outlines = not ui.objects.has_all_outlines


def _cannot_edit(session: SessionView) -> str:
    return "" if session.edits.can_edit else session.edits.why_not or "Objects cannot be changed now."


def _cannot_make(session: SessionView) -> str:
    return _cannot_edit(session) or ("" if session.selection.n_gaussians else "Nothing is selected.")


def _no_objects(session: SessionView) -> str:
    return "" if session.edits.objects else "There are no objects yet."


def _cannot_correct(session: SessionView) -> str:
    return _no_objects(session) or _cannot_make(session)


ACTIONS = (
    Action("objects.make", "New object from selection", EDIT, _make, keys=("Ctrl+Shift+G",), lacks=_cannot_make),
    Action(
        "objects.add",
        "Add selection to object",
        EDIT,
        _of_chosen(lambda object_id: CorrectObject(object_id, adds=True)),
        keys=("Alt+I",),
        lacks=_cannot_correct,
    ),
    Action(
        "objects.subtract",
        "Remove selection from object",
        EDIT,
        _of_chosen(lambda object_id: CorrectObject(object_id, adds=False)),
        keys=("Alt+Shift+I",),
        lacks=_cannot_correct,
    ),
    Action(
        "objects.find",
        "Find object again in all clips",
        EDIT,
        _of_chosen(FindObject),
        lacks=lambda session: _no_objects(session) or _cannot_edit(session),
    ),
    Action("objects.select", "Select object", SELECT, _of_chosen(SelectObject), keys=("Alt+O",), lacks=_no_objects),
    Action("objects.next", "Choose next object", SELECT, _next, keys=("Alt+Shift+O",), lacks=_no_objects),
    Action("objects.outlines", "Outline all objects", SELECT, _outline, keys=("Ctrl+Shift+O",), lacks=_no_objects),
)
