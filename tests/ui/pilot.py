"""Pilot: pointer and keys for a headless window, aimed at the rectangles that the panels record."""

from __future__ import annotations

from typing import Any

import numpy as np
from pyglet.window import key, mouse

from ui.panels.state import Rect
from ui.shell.screenshot import read_window


class Pilot:
    """Sends pyglet events to a StudioWindow and draws the frames between them."""

    def __init__(self, studio: Any) -> None:
        self.studio = studio
        self.session = studio.session
        self.x, self.y = 0.0, 0.0

    @property
    def rects(self) -> dict[str, Rect]:
        """Where things were drawn last."""
        return self.studio.frame.ui.rects

    def draw(self, frames: int = 1) -> None:
        """Draw some frames, each with its update."""
        for _ in range(frames):
            self.studio.frame.update(1 / 60)
            self.studio.draw()

    def rest(self, turns: int = 120) -> None:
        """Turn the window's loop as if nobody touched anything, until it stops drawing.

        Raises:
            AssertionError: It never does.
        """
        for _ in range(turns):
            if not self.studio.frame.update(1 / 60):
                return
            self.studio.draw()
        raise AssertionError(f"the window still draws after {turns} turns without any input")

    def tap(self, x: float, y: float, button: int = mouse.LEFT) -> None:
        """Move, press and release with no frame between, as a tap on a tablet does; then let the loop rest."""
        self.x, self.y = x, y
        self._send("on_mouse_motion", *self._at(), 1, 1)
        self._send("on_mouse_press", *self._at(), button, 0)
        self._send("on_mouse_release", *self._at(), button, 0)
        self.rest()

    def picture(self) -> np.ndarray:
        """What stands in the window. [H, W, 3] uint8"""
        return read_window(self.studio.ctx, *self.studio.window.get_framebuffer_size())

    def _send(self, name: str, *arguments: Any) -> None:
        self.studio.window.dispatch_event(name, *arguments)

    def _at(self) -> tuple[float, float]:
        """Where the pointer is, as pyglet counts: pixels, rows upwards."""
        scale = self.studio.frame.backend.pixels_per_unit
        return self.x * scale, self.studio.window.height - 1 - self.y * scale

    def move(self, x: float, y: float) -> None:
        """Pointer to window coordinates (y down), no button held."""
        dx, dy = x - self.x, self.y - y
        self.x, self.y = x, y
        self._send("on_mouse_motion", *self._at(), dx, dy)
        self.draw()

    def press(self, button: int = mouse.LEFT) -> None:
        """Button down where the pointer is."""
        self._send("on_mouse_press", *self._at(), button, 0)
        self.draw()

    def release(self, button: int = mouse.LEFT) -> None:
        """Button up where the pointer is."""
        self._send("on_mouse_release", *self._at(), button, 0)
        self.draw()

    def drag(self, start: tuple[float, float], stop: tuple[float, float], *, button: int = mouse.LEFT, steps: int = 4):
        """Press at start, move in steps, release at stop."""
        self.move(*start)
        self.press(button)
        for i in range(1, steps + 1):
            x = start[0] + (stop[0] - start[0]) * i / steps
            y = start[1] + (stop[1] - start[1]) * i / steps
            dx, dy = x - self.x, self.y - y
            self.x, self.y = x, y
            self._send("on_mouse_drag", *self._at(), dx, dy, button, 0)
            self.draw()
        self.release(button)

    def click(self, name: str) -> None:
        """Click the middle of a recorded rectangle."""
        self.move(*self.rects[name].center)
        self.press()
        self.release()
        self.draw()

    def wheel(self, ticks: float) -> None:
        """Turn the wheel where the pointer is."""
        self._send("on_mouse_scroll", *self._at(), 0.0, ticks)
        self.draw(2)

    def key(self, symbol: int, *, modifiers: tuple[int, ...] = ()) -> None:
        """Press and release a key, with modifier keys held around it."""
        for modifier in modifiers:
            self._send("on_key_press", modifier, 0)
        self._send("on_key_press", symbol, 0)
        self.draw()
        self._send("on_key_release", symbol, 0)
        for modifier in modifiers:
            self._send("on_key_release", modifier, 0)
        self.draw(2)

    def type(self, text: str) -> None:
        """Characters as the keyboard layout delivers them."""
        for character in text:
            self._send("on_text", character)
        self.draw(2)

    def sent(self, kind: type) -> list[Any]:
        """Commands of one type that the window dispatched so far."""
        return [command for command in self.session.commands if isinstance(command, kind)]


CTRL = key.LCTRL
SHIFT = key.LSHIFT
