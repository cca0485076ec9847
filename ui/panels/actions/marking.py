"""Actions on regions that are marked as static or as moving."""

from __future__ import annotations

from typing import Any

from app.session.commands import RedoMark, RemoveRegion, UndoMark
from ui.panels.actions.action import MARK, Action, ActionNeeds, Run
from ui.panels.regions import begin_choosing
from ui.panels.state import REGIONS, Dispatch, UiState
from ui.viewport.region_tool import GROWTH


def _choose_region(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    begin_choosing(session, ui)


def _mark_chosen(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.regions.is_accepted = True  # the viewport marks it, once it knows where the pointer is


def _leave_choosing(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.regions.leave()


def _grow_by(factor: float) -> Run:
    def grow(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.set_radius(ui.regions.radius * factor)

    return grow


def _shift_by(right: float, down: float, forward: float) -> Run:
    def shift(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.shift(session.view.world_to_camera(), right, down, forward)

    return shift


def _next_region(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.wanted_panel = REGIONS
    ui.regions.highlight_next(len(session.regions.regions))


def _remove_region(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if ui.regions.highlighted is not None and session.regions.can_mark:
        dispatch(RemoveRegion(ui.regions.highlighted))


def _undo_mark(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.regions.can_undo:
        dispatch(UndoMark())


def _redo_mark(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.regions.can_redo:
        dispatch(RedoMark())


def _cannot_mark(session: ActionNeeds) -> str:
    return "" if session.regions.can_mark else session.regions.why_not or "Regions cannot be marked now."


def _no_undo(session: ActionNeeds) -> str:
    return "" if session.regions.can_undo else "There is no mark to take back."


_STEERING: dict[str, Any] = {"needs_choosing": True, "repeats": True}

ACTIONS = (
    Action("mark.choose", "Mark a sphere as static or moving; again to switch", MARK, _choose_region, keys=("M",)),
    Action("mark.accept", "Mark the chosen sphere", MARK, _mark_chosen, keys=("Enter",), needs_choosing=True),
    Action("mark.leave", "Leave without marking", MARK, _leave_choosing, keys=("Escape",), needs_choosing=True),
    Action("mark.smaller", "Smaller sphere", MARK, _grow_by(1 / GROWTH), keys=("-",), **_STEERING),
    Action("mark.larger", "Larger sphere", MARK, _grow_by(GROWTH), keys=("+",), **_STEERING),
    Action("mark.left", "Sphere to the left", MARK, _shift_by(-1, 0, 0), keys=("Ctrl+Left",), **_STEERING),
    Action("mark.right", "Sphere to the right", MARK, _shift_by(1, 0, 0), keys=("Ctrl+Right",), **_STEERING),
    Action("mark.up", "Sphere up", MARK, _shift_by(0, -1, 0), keys=("Ctrl+Up",), **_STEERING),
    Action("mark.down", "Sphere down", MARK, _shift_by(0, 1, 0), keys=("Ctrl+Down",), **_STEERING),
    Action("mark.farther", "Sphere farther away", MARK, _shift_by(0, 0, 1), keys=("Page Up",), **_STEERING),
    Action("mark.nearer", "Sphere nearer", MARK, _shift_by(0, 0, -1), keys=("Page Down",), **_STEERING),
    Action("mark.highlight_next", "Highlight the next marked region", MARK, _next_region, keys=("N",)),
    Action("mark.remove", "Remove the highlighted region", MARK, _remove_region, keys=("Delete",), lacks=_cannot_mark),
    Action("mark.undo", "Take back the last mark or removal", MARK, _undo_mark, keys=("Ctrl+Z",), lacks=_no_undo),
    Action(
        "mark.redo",
        "Do again what was taken back",
        MARK,
        _redo_mark,
        keys=("Ctrl+Shift+Z", "Ctrl+Y"),
        lacks=lambda session: "" if session.regions.can_redo else "Nothing was taken back.",
    ),
)
