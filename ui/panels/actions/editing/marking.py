"""Actions on regions that are marked as static or as moving."""

from __future__ import annotations

from typing import Any

from app.session.mending.mend_commands import CloseMend
from app.session.session_view import SessionView
from ui.panels.actions.action import MARK, Action, Run
from ui.panels.actions.editing.camera_path import nudge_key
from ui.panels.editing.mend_panel import is_asking_to_mend
from ui.panels.editing.panel.marks import begin_choosing
from ui.panels.state import Dispatch, UiState
from ui.viewport.region_tool import GROWTH


def _choose_region(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    begin_choosing(session, ui)


def _mark_chosen(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.regions.is_accepted = True  # the viewport marks it, once it knows where the pointer is


def _leave_choosing(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if ui.editing.held is not None:  # the drag of a handle is given back, and nothing else
        return
    if is_asking_to_mend(session):  # that window lies on top
        dispatch(CloseMend())
        return
    if ui.editing.asking is None and (ui.selecting.is_active or ui.regions.is_active):
        ui.selecting.leave()
        ui.regions.leave()
    else:
        ui.editing.leave()


def _grow_by(factor: float) -> Run:
    def grow(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        ui.regions.set_radius(ui.regions.radius * factor)

    return grow


def _shift_by(right: float, down: float, forward: float) -> Run:
    def shift(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if ui.regions.is_active:
            ui.regions.shift(session.view.world_to_camera(), right, down, forward)
        else:
            nudge_key(session, dispatch, ui, (right, down, forward))

    return shift


def _next_region(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.show_edit("regions")
    ui.regions.highlight_next(len(session.regions.regions))


_SIZING: dict[str, Any] = {"needs_choosing": True, "repeats": True}
_STEERING: dict[str, Any] = _SIZING | {"moves_keys": True}

ACTIONS = (
    Action("mark.choose", "Mark a sphere as static or moving; again to switch", MARK, _choose_region, keys=("M",)),
    Action("mark.accept", "Mark the chosen sphere", MARK, _mark_chosen, keys=("Enter",), needs_choosing=True),
    Action(
        "mark.leave",
        "Leave the tool, then the chosen edit",
        MARK,
        _leave_choosing,
        keys=("Escape",),
        needs_choosing=True,
        leaves_tool=True,
    ),
    Action("mark.smaller", "Smaller sphere", MARK, _grow_by(1 / GROWTH), keys=("-",), **_SIZING),
    Action("mark.larger", "Larger sphere", MARK, _grow_by(GROWTH), keys=("+",), **_SIZING),
    Action(
        "mark.left",
        "Move the chosen sphere or camera key left",
        MARK,
        _shift_by(-1, 0, 0),
        keys=("Ctrl+Left",),
        **_STEERING,
    ),
    Action(
        "mark.right",
        "Move the chosen sphere or camera key right",
        MARK,
        _shift_by(1, 0, 0),
        keys=("Ctrl+Right",),
        **_STEERING,
    ),
    Action(
        "mark.up", "Move the chosen sphere or camera key up", MARK, _shift_by(0, -1, 0), keys=("Ctrl+Up",), **_STEERING
    ),
    Action(
        "mark.down",
        "Move the chosen sphere or camera key down",
        MARK,
        _shift_by(0, 1, 0),
        keys=("Ctrl+Down",),
        **_STEERING,
    ),
    Action(
        "mark.farther",
        "Move the chosen sphere or camera key farther away",
        MARK,
        _shift_by(0, 0, 1),
        keys=("Page Up",),
        **_STEERING,
    ),
    Action(
        "mark.nearer",
        "Move the chosen sphere or camera key nearer",
        MARK,
        _shift_by(0, 0, -1),
        keys=("Page Down",),
        **_STEERING,
    ),
    Action("mark.highlight_next", "Highlight the next marked region", MARK, _next_region, keys=("N",)),
)
