"""Actions on the meaning of colours, and on the drawn part of a clip."""

from __future__ import annotations

from collections.abc import Callable

from app.playback.modes.view_modes import CONTENTS, MODES
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetContent, SetMode
from ui.panels.actions.action import MODE, Action, Run
from ui.panels.state import Dispatch, UiState


def _set_mode(mode: str) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(SetMode(mode))

    return show


def _has_mode(mode: str) -> Callable[[SessionView], bool]:
    return lambda session: session.overlays.mode == mode


def _set_content(content: str) -> Run:
    def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(SetContent(content))

    return show


def _has_content(content: str) -> Callable[[SessionView], bool]:
    return lambda session: session.overlays.content == content


def mode_key(mode: str) -> str:
    """The key of a mode: Shift and its number in the order of the menu."""
    return f"Shift+{list(MODES).index(mode) + 1}"


ACTIONS = (
    *(
        Action(
            f"mode.{mode.name}",
            f"Mode: {mode.label}",
            MODE,
            _set_mode(mode.name),
            keys=(mode_key(mode.name),),
            is_on=_has_mode(mode.name),
        )
        for mode in MODES.values()
    ),
    *(
        Action(
            f"content.{content.name}",
            f"Draw: {content.label}",
            MODE,
            _set_content(content.name),
            is_on=_has_content(content.name),
        )
        for content in CONTENTS.values()
    ),
)
