"""Actions that copy what was done, or can be done, as a command."""

from __future__ import annotations

from collections.abc import Callable

from app.command_text.command_text import CommandText
from app.session.session_view import SessionView
from ui.panels.actions.action import EDIT, TRAIN, Action, Run
from ui.panels.pieces.copying import copy_command, copy_python
from ui.panels.state import Dispatch, UiState

MENU = "Edit/Copy as command"
_WAYS = (("command", "command", copy_command), ("python", "Python", copy_python))


def _copy(way: Callable[[Callable[[], CommandText]], None], of: Callable[[SessionView], CommandText]) -> Run:
    def copy(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        way(lambda: of(session))

    return copy


def _last_step(session: SessionView) -> CommandText:
    return session.command_texts.step()


def _training(session: SessionView) -> CommandText:
    clip = session.timeline.clip
    return session.command_texts.training(0 if clip is None else clip.clip_index)


def _no_step(session: SessionView) -> str:
    return "" if session.history.undo else "No step to copy yet."


ACTIONS = (
    *(
        Action(
            f"edit.copy_{id_}", f"Copy last step as {words}", EDIT, _copy(way, _last_step), menu=MENU, lacks=_no_step
        )
        for id_, words, way in _WAYS
    ),
    *(
        Action(
            f"train.copy_{id_}", f"Copy the training of this clip as {words}", TRAIN, _copy(way, _training), menu=MENU
        )
        for id_, words, way in _WAYS
    ),
)
