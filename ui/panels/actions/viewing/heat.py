"""Actions on residual heat maps: which one is shown."""

from __future__ import annotations

from app.residuals.heat_map import HEAT_KINDS
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, ShowHeat
from ui.panels.actions.action import COMPARE, Action
from ui.panels.actions.viewing.view import nearest_camera
from ui.panels.state import Dispatch, UiState

FIRST_KIND = "E"
"""The kind shown where none was chosen before: flicker is what one looks for in a clip stream."""


def _toggle(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    shown = session.overlays.heat
    ui.last_heat = shown or ui.last_heat or FIRST_KIND
    dispatch(ShowHeat("" if shown else ui.last_heat))


def _next_kind(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    kinds = list(HEAT_KINDS)
    shown = session.overlays.heat
    dispatch(ShowHeat(kinds[(kinds.index(shown) + 1) % len(kinds)] if shown else FIRST_KIND))


def _kind_action(name: str, label: str) -> Action:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if session.view.look_through is None:  # a map over pixels needs a camera that took some
            dispatch(LookThrough(nearest_camera(session)))
        dispatch(ShowHeat(name))

    return Action(
        f"heat.{name}", f"Heat map: {label}", COMPARE, show, is_on=lambda session: session.overlays.heat == name
    )


ACTIONS = (
    Action(
        "heat.toggle",
        "Residual heat map on or off; in a free view, residual of each anchor",
        COMPARE,
        _toggle,
        keys=("7",),
        is_on=lambda session: bool(session.overlays.heat),
    ),
    Action("heat.next", "Next kind of residual", COMPARE, _next_kind, keys=("8",)),
    *(_kind_action(kind.name, kind.label) for kind in HEAT_KINDS.values()),
)
