"""Action: one thing a user can do, with its words, its keys and what it runs. Help sheet, menus and keys read the same
rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from app.playback.bookmarks import Bookmarks
from app.playback.orbit_view import OrbitView
from app.playback.timeline import Timeline
from app.playback.views import Views
from app.status import Overlays, QueueStatus, TrainingStatus, WantedFrame
from engine.camera.rig import CameraRig
from ui.panels.actions.key import Key, parse_key
from ui.panels.regions import RegionsNeeds
from ui.panels.state import Dispatch, UiState

TIME, PLAY, VIEW, COMPARE = "Time", "Play and timeline", "View", "Show and compare"
MARK, TRAIN, WINDOW = "Mark regions", "Train", "Window"
NAVIGATE, BOOKMARKS, MODE = "Navigate", "Bookmarks", "View mode"


class ActionNeeds(RegionsNeeds, Protocol):
    """What actions act on."""

    @property
    def timeline(self) -> Timeline: ...

    @property
    def view(self) -> OrbitView: ...

    @property
    def views(self) -> Views: ...

    @property
    def bookmarks(self) -> Bookmarks: ...

    @property
    def overlays(self) -> Overlays: ...

    @property
    def rig(self) -> CameraRig: ...

    @property
    def training(self) -> TrainingStatus: ...

    @property
    def queue(self) -> QueueStatus: ...

    def wanted_frame(self) -> WantedFrame | None: ...


Run = Callable[[ActionNeeds, Dispatch, UiState], None]


@dataclass(frozen=True)
class Action:
    """One row.

    Attributes:
        id: Its name in preferences; never changes.
        text: What it does, for the help sheet, menus and the palette.
        group: Heading of the help sheet.
        keys: As text, see ui.panels.actions.key; the first one is shown in menus. Empty where it has none.
        needs_capture: Ignored until a capture is open.
        needs_choosing: Ignored unless a region is being chosen.
        repeats: Holding the key repeats the action.
        is_in_help: Shown on the help sheet; of a row of keys that do alike, one is enough there.
        is_on: Of what can be on or off, whether it is; menus show a tick.
    """

    id: str
    text: str
    group: str
    run: Run
    keys: tuple[str, ...] = ()
    needs_capture: bool = True
    needs_choosing: bool = False
    repeats: bool = False
    is_on: Callable[[ActionNeeds], bool] | None = None
    is_in_help: bool = True

    @cached_property
    def parsed_keys(self) -> tuple[Key, ...]:
        """Its keys, parsed."""
        return tuple(parse_key(label) for label in self.keys)

    @property
    def key_label(self) -> str:
        """The key that menus show; empty without one."""
        return self.keys[0] if self.keys else ""

    def is_offered(self, session: ActionNeeds, ui: UiState) -> bool:
        """Whether it can be run now."""
        if self.needs_capture and session.capture is None:
            return False
        return ui.regions.is_active or not self.needs_choosing
