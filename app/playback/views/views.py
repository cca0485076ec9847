"""Views: one, two or four pictures of the same frame, each from its own place and with its own overlays.

One of them is active: keys, menus and the toolbar act on it. While one of the others is drawn, it takes that place, so
that everything that draws or reacts to the pointer there needs to know of one view only.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from app.playback.views.orbit_view import OrbitView
from app.status import Overlays
from engine.camera.rig import CameraRig

COUNTS = (1, 2, 4)
"""How many views there can be side by side."""


@dataclass
class ViewState:
    """Pose and contents of one view."""

    view: OrbitView = field(default_factory=OrbitView)
    overlays: Overlays = field(default_factory=Overlays)


class Views:
    """The views of a session.

    Attributes:
        n_shown: One of COUNTS.
    """

    def __init__(self) -> None:
        self.n_shown = 1
        self._looks = [ViewState()]
        self._active = 0
        self._drawn: int | None = None

    @property
    def active_index(self) -> int:
        """The view that keys act on."""
        return self._active

    @property
    def current_index(self) -> int:
        """The view that is drawn at the moment, else the active one."""
        return self._active if self._drawn is None else self._drawn

    @property
    def current(self) -> ViewState:
        """The state of view `current_index`."""
        return self._looks[self.current_index]

    @property
    def shown(self) -> list[ViewState]:
        """Everything that is on screen, in order."""
        return self._looks[: self.n_shown]

    @contextmanager
    def drawn(self, index: int) -> Iterator[None]:
        """While this lasts, the view with this index is the current one."""
        before, self._drawn = self._drawn, index
        try:
            yield
        finally:
            self._drawn = before

    def show(self, n: int) -> None:
        """Show this many views. New ones look as the active one does, and are independent from then on.

        Raises:
            ValueError: There is no such layout.
        """
        if n not in COUNTS:
            raise ValueError(f"there can be {', '.join(str(count) for count in COUNTS)} views, not {n}")
        if n < self.n_shown and self._active >= n:  # the active view stays
            self._looks[0], self._looks[self._active] = self._looks[self._active], self._looks[0]
            self._active = 0
        while len(self._looks) < n:
            self._looks.append(self._copied(self._looks[self._active]))
        self.n_shown = n
        self._active = min(self._active, n - 1)

    def activate(self, index: int) -> None:
        """Let keys act on another view; one that is not shown changes nothing."""
        if 0 <= index < self.n_shown:
            self._active = index

    def look_at(self, rig: CameraRig) -> None:
        """Take up another capture: each view frames it anew, and keeps its overlays."""
        for look in self._looks:
            look.view = OrbitView(rig)

    def set_scene_up(self, up: Sequence[float] | None) -> None:
        """Set the scene's upward direction; see OrbitView.set_scene_up."""
        for look in self._looks:
            look.view.set_scene_up(up)

    def correct(self, rig: CameraRig) -> None:
        """Show the same cameras as a training has corrected them; free views stay where they are."""
        for look in self._looks:
            look.view.rig = rig

    def _copied(self, look: ViewState) -> ViewState:
        view = copy.copy(look.view)  # a rig is shared, the pose is not
        view.pivot, view.up = look.view.pivot.copy(), look.view.up.copy()
        return ViewState(view, copy.copy(look.overlays))
