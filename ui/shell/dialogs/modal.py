"""Modal: a dialog in the middle of the window that is up as long as something is asked, and what its keys mean."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

MAX_TRIES = 8
"""A dialog that comes up with the window is lost while panels find their places; it is opened so many times."""


@dataclass(frozen=True, slots=True)
class ModalKeys:
    """Keys pressed in this frame.

    Attributes:
        is_agreed: Enter.
        is_left: Escape.
        is_closed: The cross in the corner.
        is_up: Whether the dialog can be drawn, and has to be ended by imgui.end_popup().
    """

    is_agreed: bool = False
    is_left: bool = False
    is_closed: bool = False
    is_up: bool = True


class Modal:
    """Owns the question of the frame before, and whether a list was open in the dialog."""

    def __init__(self) -> None:
        self._asked: object = None
        self._n_tries = 0
        self._is_listing = False

    def begin(self, asked: object, title: str, size: tuple[float, float]) -> ModalKeys | None:
        """Begin the dialog of what is asked; None where it is not up.

        Args:
            asked: None while nothing is; another object opens the dialog anew.
            title: Words of the title bar and, after "###", the dialog's own name.
            size: In units; smaller in a small window.
        """
        is_new, self._asked = asked is not None and asked is not self._asked, asked
        if asked is None:
            return None
        if is_new:
            self._n_tries = 0
        if is_new or (self._n_tries < MAX_TRIES and not imgui.is_popup_open(title)):
            self._n_tries += 1
            imgui.open_popup(title)
        viewport = imgui.get_main_viewport()
        width, height = min(size[0], viewport.work_size.x - 24), min(size[1], viewport.work_size.y - 24)
        imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(width, height))
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize
        is_open, is_kept = imgui.begin_popup_modal(title, True, flags)
        if not is_open:
            return None if is_new else ModalKeys(is_closed=True, is_up=False)
        # the key that led here is still pressed in the first frame; while typing, Enter only ends the text; in a list
        # that is open it chooses, and Escape closes the list
        was_listing, self._is_listing = self._is_listing, imgui.is_popup_open("", imgui.PopupFlags_.any_popup_id)
        is_listing = was_listing or self._is_listing  # Escape has closed it already
        is_free = not is_new and not is_listing and not imgui.get_io().want_text_input
        is_enter = imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False)
        is_escape = imgui.is_key_pressed(imgui.Key.escape, False)
        return ModalKeys(is_free and is_enter, is_free and is_escape, not is_kept)
