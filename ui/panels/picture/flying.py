"""Flying with W A S D, Q and E while they are held: the view gathers speed and loses it again, frame by frame."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import imgui

from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from ui.panels.picture.gestures import FLY_KEYS
from ui.panels.state import Dispatch, UiState

RADII_PER_S = 0.5
"""Speed, in scene radii."""
FASTER, SLOWER = 10.0, 0.1
"""With Shift, and with Alt."""
GATHER_S = 0.07
"""Time constant of gathering and losing speed."""
STANDING = 0.01
"""Below this share of the ordinary speed the view stands."""
LONGEST_STEP_S = 0.1


class Flying:
    """The speed of one view. To the right, up and ahead, scene units per second. [3]"""

    def __init__(self) -> None:
        self._velocity = np.zeros(3)
        self.is_flying = False
        """Are keys held?"""
        self._taken: set[str] = set()
        """Letters that were part of something else, until they are released: Ctrl often comes up before its letter."""

    def follow(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> bool:
        """Move the view on by one frame. Whether it moves."""
        io, view = imgui.get_io(), session.view
        held = {name for name in FLY_KEYS if imgui.is_key_down(getattr(imgui.Key, name))}
        self._taken = held if _are_keys_taken(ui) else self._taken & held
        wanted = _direction(held - self._taken)
        was_standing = not self.is_flying and not self._velocity.any()
        self.is_flying = bool(wanted.any())
        if was_standing and not self.is_flying:
            return False
        if self.is_flying and view.look_through is not None:
            dispatch(LookThrough(None))
        speed = RADII_PER_S * view.radius
        boost = (FASTER if io.key_shift else 1.0) * (SLOWER if io.key_alt else 1.0)
        # The time since the frame before it was pressed says nothing: the window may have slept for hours.
        dt_s = 0.0 if was_standing else min(io.delta_time, LONGEST_STEP_S)
        left = math.exp(-dt_s / GATHER_S)
        self._velocity = left * self._velocity + (1.0 - left) * speed * boost * wanted
        if not self.is_flying and np.linalg.norm(self._velocity) < STANDING * speed:
            self._velocity = np.zeros(3)
        if self._velocity.any():
            view.fly(*(dt_s * self._velocity))
        return True


def _direction(held: set[str]) -> np.ndarray:
    """Where held keys lead to: to the right, up and ahead, of unit length or zero. [3]"""
    total = np.sum([FLY_KEYS[name] for name in held], axis=0) if held else np.zeros(3)
    length = float(np.linalg.norm(total))
    return total / length if length > 0.0 else total


def _are_keys_taken(ui: UiState) -> bool:
    """Do letters belong to something else: a text field, a menu, or a chord with Ctrl?"""
    io = imgui.get_io()
    return io.want_text_input or ui.is_popup_open or ui.is_help_open or io.key_ctrl
