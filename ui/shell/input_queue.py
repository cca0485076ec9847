"""InputQueue: events on their way from the window to Dear ImGui, in the order in which they came.

A key that does something is taken in by a frame of its own before what came after it is passed on: what it opens is
there by then, however slow frames are, and what was typed goes to where it was meant.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

MOST_HELD_FRAMES = 4
"""After so many frames events are passed on, even if whatever they are held for has not come."""


class InputQueue:
    """Owns events that wait for a frame."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], bool]] = deque()
        self._is_frame_due = False
        self._n_held = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, event: Callable[[], bool]) -> None:
        """Pass an event on, now or after the frame that one before it is waiting for.

        Args:
            event: Returns whether a frame has to be drawn before the next one.
        """
        self._waiting.append(event)
        self._pass_on()

    def after_frame(self, *, is_held: bool) -> None:
        """A frame was drawn: pass on what waited for it. is_held: Something that takes keys is about to come up."""
        self._n_held = self._n_held + 1 if is_held else 0
        self._is_frame_due = is_held and self._n_held <= MOST_HELD_FRAMES
        self._pass_on()

    def _pass_on(self) -> None:
        while self._waiting and not self._is_frame_due:
            self._is_frame_due = self._waiting.popleft()()
