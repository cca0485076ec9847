"""Actions of the capture doctor."""

from __future__ import annotations

from app.session.captures.capture_commands import ExamineCapture
from app.session.session_view import SessionView
from ui.panels.actions.action import WINDOW, Action
from ui.panels.state import DOCTOR, Dispatch, UiState


def _examine(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_picture_only = False
    ui.wanted_panel = DOCTOR
    dispatch(ExamineCapture())


ACTIONS = (Action("doctor.examine", "Examine the capture for problems", WINDOW, _examine, menu="File"),)
