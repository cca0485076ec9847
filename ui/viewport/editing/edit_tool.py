"""Editing by the user, in the picture and in the panel. State of the window; no ImGui, no GL."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from app.session.editing.scope_choice import ScopeChoice
from engine.editing.actions import Transform
from engine.editing.edit import Edit
from engine.editing.volumes.keyed_volume import volume_of
from ui.viewport.editing.handles import Handle, Thing

TOGETHER_S = 1.0
"""Presses of keys that follow each other within this time are one step back."""
Asking = Literal["ground", "length"]
N_ASKED: dict[Asking, int] = {"ground": 3, "length": 2}
"""How many points of the scene are asked for."""


@dataclass(eq=False)
class EditTool:
    """Which edit is chosen, and what is being done to it.

    Attributes:
        chosen: Number of the edit whose details and handles are shown; None without one.
        is_shape_meant: Of an edit that moves what is in a volume: whether handles are those of that shape.
        scope: Where new edits are to hold.
        is_outside: Of a volume that was drawn: whether everything outside of it is meant.
        gesture: Number of what is being done; see app.session.editing.edit_commands.
        held: The handle that is dragged; None while none is.
        held_thing, held_at: The thing it belonged to when the drag began, and where in the picture that was, px.
        has_dragged: Whether the drag has changed anything.
        pointed: The handle under the pointer; None without one.
        asking: Purpose of the scene points being asked for; None while none are.
        points: Those that were given, scene units, [3] each.
        length_m: Known length between two points, m.
        is_new: Whether the chosen edit was made or chosen by key just now: its details are brought into sight.
        is_row_clicked: Whether it was chosen just now by a click on its row.
        details_height: Of the details, as they were drawn last, units.
        renamed: The name that is being written; None while it is that of the edit.
        wanted_section: The part of the panel that is to come into sight; empty for none.
        used_sections: Parts of the panel whose tool is in use, as it was drawn last.
        timed: Number of the volume's key that is pressed on the timeline; None while none is.
        timed_from: Where it was pressed, units of the screen; None once that has become a drag.
    """

    chosen: int | None = None
    is_shape_meant: bool = False
    scope: ScopeChoice = "everywhere"
    is_outside: bool = False
    gesture: int = 0
    held: Handle | None = None
    held_thing: Thing | None = None
    held_at: tuple[float, float] = (0.0, 0.0)
    has_dragged: bool = False
    pointed: Handle | None = None
    asking: Asking | None = None
    points: list[np.ndarray] = field(default_factory=list)
    length_m: float = 1.0
    is_new: bool = False
    is_row_clicked: bool = False
    details_height: float = 0.0
    renamed: str | None = None
    wanted_section: str = ""
    used_sections: set[str] = field(default_factory=set)
    timed: int | None = None
    timed_from: float | None = None
    _pressed_s: float = -1e9

    def follow(self, edits: tuple[Edit, ...]) -> None:
        """Drop everything of an edit that is gone."""
        if self.chosen is not None and all(edit.edit_id != self.chosen for edit in edits):
            self.choose(None)

    def choose(self, edit_id: int | None) -> None:
        """Let another edit stand out."""
        self.chosen, self.renamed, self.is_shape_meant = edit_id, None, False

    def begin_gesture(self) -> int:
        """Start something that is taken back at once. Returns its number."""
        self.gesture += 1
        return self.gesture

    def press_gesture(self) -> int:
        """A key was pressed: part of the presses before, if they were a moment ago."""
        now_s = time.monotonic()
        if now_s - self._pressed_s > TOGETHER_S:
            self.begin_gesture()
        self._pressed_s = now_s
        return self.gesture

    def hold(self, handle: Handle, thing: Thing, at: tuple[float, float]) -> None:
        """A handle was pressed. at: px of the picture."""
        self.held, self.held_thing, self.held_at, self.has_dragged = handle, thing, at, False
        self.begin_gesture()

    def release(self) -> None:
        """The drag is over."""
        self.held = self.held_thing = None
        self.has_dragged = False

    def ask(self, asking: Asking | None) -> None:
        """Ask for points of the scene; None ends it."""
        self.asking, self.points = asking, []

    @property
    def is_active(self) -> bool:
        """Whether there is something to leave."""
        return self.chosen is not None or self.asking is not None

    def leave(self) -> None:
        """Ask for no more points; without that, let no edit stand out."""
        if self.asking is not None:
            self.ask(None)
        else:
            self.choose(None)

    def shown_thing(self, edit: Edit | None, frame: float) -> Thing | None:
        """What has handles of the chosen edit: the movement that it makes, else the volume it acts on at a frame."""
        if edit is None:
            return None
        volume = volume_of(edit.target, frame)
        if isinstance(edit.action, Transform) and not (self.is_shape_meant and volume is not None):
            return edit.action
        return volume
