"""Actions on bookmarks: views that one comes back to."""

from __future__ import annotations

from collections.abc import Callable

from app.playback.views.bookmarks import NUMBERS, Bookmark
from app.playback.views.view_place import ViewPlace
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from ui.panels.actions.action import BOOKMARKS, Action, Run
from ui.panels.state import Dispatch, UiState


def go_to_bookmark(session: SessionView, dispatch: Dispatch, bookmark: Bookmark) -> None:
    """Look from there, at its frame if it has one that the capture has."""
    bookmark.place.show(session.view)
    if bookmark.frame_index is not None and bookmark.frame_index <= session.timeline.last_frame:
        dispatch(SetFrame(bookmark.frame_index))


def _go(number: int) -> Run:
    def go(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        bookmark = session.bookmarks.numbered(number)
        if bookmark is not None:
            go_to_bookmark(session, dispatch, bookmark)

    return go


def _no_bookmark(number: int) -> Callable[[SessionView], str]:
    why_not = f"There is no bookmark {number} yet."
    return lambda session: "" if session.bookmarks.numbered(number) is not None else why_not


def _keep(number: int) -> Run:
    def keep(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        session.bookmarks.set_numbered(number, ViewPlace.of(session.view))

    return keep


def _open(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_view_popup_wanted = True


def _numbered(number: int) -> tuple[Action, Action]:
    is_first = number == NUMBERS[0]
    others = f"; {NUMBERS[1]} to {NUMBERS[-1]} likewise" if is_first else ""
    return (
        Action(
            f"bookmark.go{number}",
            f"Go to bookmark {number}{others}",
            BOOKMARKS,
            _go(number),
            keys=(f"Ctrl+{number}",),
            lacks=_no_bookmark(number),
            is_in_help=is_first,
        ),
        Action(
            f"bookmark.keep{number}",
            f"Save this view as bookmark {number}{others}",
            BOOKMARKS,
            _keep(number),
            keys=(f"Ctrl+Shift+{number}",),
            is_in_help=is_first,
        ),
    )


ACTIONS = (
    Action("bookmark.list", "Lens, axes and bookmarks", BOOKMARKS, _open, keys=("Ctrl+B",)),
    *(action for number in NUMBERS for action in _numbered(number)),
)
