"""Actions of exports."""

from __future__ import annotations

from app.session.export_commands import AskExport
from app.session.session_view import SessionView
from ui.panels.actions.action import WINDOW, Action
from ui.panels.state import Dispatch, UiState


def _export(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(AskExport())


ACTIONS = (
    Action(
        "export.ask",
        "Export: Gaussians, video, player, figures, cameras ...",
        WINDOW,
        _export,
        keys=("Ctrl+E",),
        menu="File",
    ),
)
