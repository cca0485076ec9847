"""Action: one thing a user can do, with its words, its keys and what it runs. Help sheet, menus and keys read the same
rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.session.session_view import SessionView
from ui.panels.editing.mend_panel import is_asking_to_mend
from ui.panels.state import Dispatch, UiState

TIME, PLAY, VIEW, COMPARE = "Time", "Play and timeline", "View", "Show and compare"
MARK, PATH, TRAIN, WINDOW = "Mark regions", "Camera path", "Train", "Window"
SELECT, EDIT = "Select", "Edit"
TAKE = "Edit time"
NAVIGATE, BOOKMARKS, MODE = "Navigate", "Bookmarks", "View mode"


Run = Callable[[SessionView, Dispatch, UiState], None]


@dataclass(frozen=True)
class Action:
    """One row.

    Attributes:
        id: Its name in preferences; never changes.
        text: Its effect, for the help sheet, menus and the palette.
        group: Heading of the help sheet.
        keys: Its own ones as text, see ui.panels.actions.key; the user may give it others (ui.panels.actions.key_map).
            Empty where it has none.
        needs_capture: Ignored until a capture is open.
        needs_choosing: Ignored unless a region is being chosen.
        leaves_tool: Not ignored either while a tool that selects is in use, an edit stands out, or the window of
            mending asks.
        moves_keys: Not ignored either where a key of the camera path is chosen.
        repeats: Holding the key repeats the action.
        needs_edit: Ignored unless an edit is chosen.
        is_in_help: Shown on the help sheet; of a row of keys that do alike, one is enough there.
        is_on: Of what can be on or off, whether it is; menus show a tick.
        lacks: Its missing condition at present, as a sentence; empty when it can be run.
        menu: Title of the menu it stands in; empty for that of its group, see ui.panels.actions.menus.
    """

    id: str
    text: str
    group: str
    run: Run
    keys: tuple[str, ...] = ()
    needs_capture: bool = True
    needs_choosing: bool = False
    leaves_tool: bool = False
    moves_keys: bool = False
    repeats: bool = False
    needs_edit: bool = False
    is_on: Callable[[SessionView], bool] | None = None
    lacks: Callable[[SessionView], str] | None = None
    menu: str = ""
    is_in_help: bool = True

    def is_offered(self, session: SessionView, ui: UiState) -> bool:
        """Whether it can be run now."""
        return not self.why_not(session, ui)

    def why_not(self, session: SessionView, ui: UiState) -> str:
        """Why it cannot be run now, as a sentence; empty when it can."""
        if self.needs_capture and session.capture is None:
            return "Open a capture or a project first."
        is_tool_used = ui.selecting.is_active or ui.editing.is_active or is_asking_to_mend(session)
        if self.needs_choosing and not (ui.regions.is_active or (self.leaves_tool and is_tool_used)):
            if not self.moves_keys:
                return "Only available while placing a region."
            if session.paths.key is None:
                return "Only available while placing a region or with a camera key chosen."
        lacks = "" if self.lacks is None else self.lacks(session)
        if not lacks and self.needs_edit and session.edits.edit(ui.editing.chosen) is None:
            return "Choose an edit first."
        return lacks
