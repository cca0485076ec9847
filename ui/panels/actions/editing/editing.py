"""Actions that edit: what is done to what is selected or drawn, the stack, markers of up and scale, and the history."""

from __future__ import annotations

from collections.abc import Callable

from app.session.editing.edit_commands import DuplicateEdit, GoToStep, MoveEdit, RemoveEdit, SetUp, ToggleEdit
from app.session.editing.scope_choice import SCOPE_CHOICES, SCOPE_WORDS, ScopeChoice
from app.session.session_view import SessionView
from engine.editing.actions import Hide
from engine.editing.edit import Edit
from ui.panels.actions.action import EDIT, Action, Run
from ui.panels.editing.edit_subject import drawn_volume, invert_selection
from ui.panels.editing.panel.making import MAKINGS, Making, make_edit, mark_moving
from ui.panels.editing.panel.world import view_up
from ui.panels.state import HISTORY, Dispatch, UiState
from ui.viewport.editing.edit_tool import Asking


def _make(making: Making) -> Run:
    def make(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        make_edit(session, dispatch, ui, making)

    return make


def _show_again(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Switch off the edit that hid something last."""
    for edit in reversed(session.edits.edits):
        if edit.is_on and isinstance(edit.action, Hide):
            dispatch(ToggleEdit(edit.edit_id))
            return


def _hold_in(choice: ScopeChoice) -> Run:
    def hold(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.editing.scope = choice

    return hold


def _next_scope(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    following = (SCOPE_CHOICES.index(ui.editing.scope) + 1) % len(SCOPE_CHOICES)
    ui.editing.scope = SCOPE_CHOICES[following]
    ui.show_edit()


def _outside(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if drawn_volume(ui) is not None:
        invert_selection(dispatch, ui)


def _choose_by(step: int) -> Run:
    """To the next edit of the stack, up or down; to none beyond its ends."""

    def choose(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ids: list[int | None] = [None, *(edit.edit_id for edit in session.edits.edits)]
        present = ids.index(ui.editing.chosen) if ui.editing.chosen in ids else 0
        ui.editing.choose(ids[(present + step) % len(ids)])
        ui.editing.is_new = True
        ui.show_edit()

    return choose


def _of_chosen(make: Callable[[SessionView, Edit], object]) -> Run:
    """Send a command for the chosen edit, if there is one."""

    def send(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        edit = session.edits.edit(ui.editing.chosen)
        command = None if edit is None else make(session, edit)
        if command is not None:
            dispatch(command)  # type: ignore[arg-type]

    return send


def _moved_by(step: int) -> Callable[[SessionView, Edit], MoveEdit | None]:
    def moved(session: SessionView, edit: Edit) -> MoveEdit | None:
        position = session.edits.edits.index(edit) + step
        return MoveEdit(edit.edit_id, position) if 0 <= position < len(session.edits.edits) else None

    return moved


def _up_of_view(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(SetUp(view_up(session.view)))


def _ask(asking: Asking) -> Run:
    def ask(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.editing.ask(None if ui.editing.asking == asking else asking)
        if ui.editing.asking is not None:
            ui.show_edit("world")

    return ask


def _step_by(n_steps: int) -> Run:
    def step(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(GoToStep(n_steps))
        ui.wanted_panel = HISTORY

    return step


def _cannot_edit(session: SessionView) -> str:
    return "" if session.edits.can_edit else session.edits.why_not or "Nothing can be edited now."


def _no_edits(session: SessionView) -> str:
    return _cannot_edit(session) or ("" if session.edits.edits else "There are no edits yet.")


STACK = "Edit/Stack"

ACTIONS = (
    *(
        Action(f"edit.{making.name}", making.words, EDIT, _make(making), keys=making.keys, lacks=_cannot_edit)
        for making in MAKINGS
    ),
    Action(
        "edit.moving", "Set moving: mark the selection or drawn volume as moving", EDIT, mark_moving, lacks=_cannot_edit
    ),
    Action("edit.unhide", "Unhide what was hidden last", EDIT, _show_again, keys=("Alt+H",), lacks=_no_edits),
    Action("edit.outside", "Edit everything outside the drawn volume", EDIT, _outside, keys=("Shift+I",)),
    Action(
        "edit.next_scope",
        "Change the scope of new edits",
        EDIT,
        _next_scope,
        keys=("Shift+U",),
        menu="Edit/Scope of new edits",
    ),
    *(
        Action(
            f"scope.{choice}",
            f"Scope of new edits: {SCOPE_WORDS[choice]}",
            EDIT,
            _hold_in(choice),
            menu="Edit/Scope of new edits",
            is_in_help=False,
        )
        for choice in SCOPE_CHOICES
    ),
    Action("edit.above", "Choose the edit above", EDIT, _choose_by(1), keys=("Alt+Up",), menu=STACK, lacks=_no_edits),
    Action(
        "edit.below", "Choose the edit below", EDIT, _choose_by(-1), keys=("Alt+Down",), menu=STACK, lacks=_no_edits
    ),
    Action(
        "edit.raise",
        "Move the chosen edit up: applied later",
        EDIT,
        _of_chosen(_moved_by(1)),
        keys=("Alt+Shift+Up",),
        needs_edit=True,
        menu=STACK,
        lacks=_no_edits,
    ),
    Action(
        "edit.lower",
        "Move the chosen edit down: applied earlier",
        EDIT,
        _of_chosen(_moved_by(-1)),
        keys=("Alt+Shift+Down",),
        needs_edit=True,
        menu=STACK,
        lacks=_no_edits,
    ),
    Action(
        "edit.toggle",
        "Turn the chosen edit on or off",
        EDIT,
        _of_chosen(lambda session, edit: ToggleEdit(edit.edit_id)),
        keys=("Ctrl+H",),
        needs_edit=True,
        menu=STACK,
        lacks=_no_edits,
    ),
    Action(
        "edit.duplicate",
        "Duplicate the chosen edit",
        EDIT,
        _of_chosen(lambda session, edit: DuplicateEdit(edit.edit_id)),
        keys=("Ctrl+D",),
        needs_edit=True,
        menu=STACK,
        lacks=_no_edits,
    ),
    Action(
        "edit.remove",
        "Remove the chosen edit",
        EDIT,
        _of_chosen(lambda session, edit: RemoveEdit(edit.edit_id)),
        keys=("Shift+Delete",),
        needs_edit=True,
        menu=STACK,
        lacks=_no_edits,
    ),
    Action("world.up_of_view", "Set up from this view", EDIT, _up_of_view, menu="Edit/World", lacks=_cannot_edit),
    Action(
        "world.ground",
        "Set up from three points on the ground",
        EDIT,
        _ask("ground"),
        menu="Edit/World",
        lacks=_cannot_edit,
    ),
    Action(
        "world.length",
        "Set the scale from two points at a known distance",
        EDIT,
        _ask("length"),
        menu="Edit/World",
        lacks=_cannot_edit,
    ),
    Action(
        "history.first",
        "Back to the first step of the history",
        EDIT,
        _step_by(-1_000_000),
        menu="Edit/History",
        lacks=lambda session: "" if session.history.undo else "Nothing to undo.",
    ),
    Action(
        "history.last",
        "Forward to the last step of the history",
        EDIT,
        _step_by(1_000_000),
        menu="Edit/History",
        lacks=lambda session: "" if session.history.redo else "Nothing to redo.",
    ),
)
