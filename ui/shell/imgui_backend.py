"""Joins a pyglet window to Dear ImGui: events in, draw lists out.

Input is forwarded by this module, because the backend shipped with imgui-bundle gets time, y, multi-button drags and
shifted keys wrong. Drawing uses ImGui's own C++ OpenGL 3 renderer. It does not own the window, nor decide when to draw.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pyglet
from imgui_bundle import ImVec2, imgui, implot
from pyglet.event import EVENT_HANDLED
from pyglet.window import BaseWindow, key, mouse

from ui.shell.input_queue import InputQueue
from ui.shell.redraw import fingerprint
from ui.style.ui_scale import UiScale

FRAMES_BETWEEN_MENUS = 3
_FAR = -3.4e38  # ImGui's "no pointer here"

_NAMED_KEYS: dict[str, str] = {
    "TAB": "tab",
    "BACKSPACE": "backspace",
    "RETURN": "enter",
    "ESCAPE": "escape",
    "INSERT": "insert",
    "DELETE": "delete",
    "SPACE": "space",
    "LEFT": "left_arrow",
    "RIGHT": "right_arrow",
    "UP": "up_arrow",
    "DOWN": "down_arrow",
    "PAGEUP": "page_up",
    "PAGEDOWN": "page_down",
    "HOME": "home",
    "END": "end",
    "GRAVE": "grave_accent",
    "MINUS": "minus",
    "EQUAL": "equal",
    "BRACKETLEFT": "left_bracket",
    "BRACKETRIGHT": "right_bracket",
    "BACKSLASH": "backslash",
    "SEMICOLON": "semicolon",
    "APOSTROPHE": "apostrophe",
    "COMMA": "comma",
    "PERIOD": "period",
    "SLASH": "slash",
    "LSHIFT": "left_shift",
    "RSHIFT": "right_shift",
    "LCTRL": "left_ctrl",
    "RCTRL": "right_ctrl",
    "LALT": "left_alt",
    "RALT": "right_alt",
    "LCOMMAND": "left_super",
    "RCOMMAND": "right_super",
    "LWINDOWS": "left_super",
    "RWINDOWS": "right_super",
    "NUM_ENTER": "keypad_enter",
    "NUM_DECIMAL": "keypad_decimal",
    "NUM_DIVIDE": "keypad_divide",
    "NUM_MULTIPLY": "keypad_multiply",
    "NUM_SUBTRACT": "keypad_subtract",
    "NUM_ADD": "keypad_add",
}
# X11 reports the shifted symbol; ImGui wants the physical key, or a key released while Shift is down stays stuck.
_SHIFTED: dict[str, str] = {
    "EXCLAMATION": "_1",
    "AT": "_2",
    "HASH": "_3",
    "DOLLAR": "_4",
    "PERCENT": "_5",
    "ASCIICIRCUM": "_6",
    "AMPERSAND": "_7",
    "ASTERISK": "_8",
    "PARENLEFT": "_9",
    "PARENRIGHT": "_0",
    "UNDERSCORE": "minus",
    "PLUS": "equal",
    "BRACELEFT": "left_bracket",
    "BRACERIGHT": "right_bracket",
    "BAR": "backslash",
    "COLON": "semicolon",
    "DOUBLEQUOTE": "apostrophe",
    "LESS": "comma",
    "GREATER": "period",
    "QUESTION": "slash",
    "ASCIITILDE": "grave_accent",
}
_MODIFIERS: dict[str, str] = {
    "left_ctrl": "mod_ctrl",
    "right_ctrl": "mod_ctrl",
    "left_shift": "mod_shift",
    "right_shift": "mod_shift",
    "left_alt": "mod_alt",
    "right_alt": "mod_alt",
    "left_super": "mod_super",
    "right_super": "mod_super",
}


def _build_key_map() -> dict[int, Any]:
    names = {**_NAMED_KEYS, **_SHIFTED}
    names |= {letter.upper(): letter for letter in "abcdefghijklmnopqrstuvwxyz"}
    names |= {f"_{digit}": f"_{digit}" for digit in range(10)}
    names |= {f"NUM_{digit}": f"keypad{digit}" for digit in range(10)}
    names |= {f"F{n}": f"f{n}" for n in range(1, 13)}
    return {getattr(key, ours): getattr(imgui.Key, theirs) for ours, theirs in names.items() if hasattr(key, ours)}


_KEY_MAP = _build_key_map()
_TYPING = frozenset(
    int(getattr(imgui.Key, name))
    for name in (
        *"abcdefghijklmnopqrstuvwxyz",
        *(f"_{digit}" for digit in range(10)),
        *_SHIFTED.values(),
        *("comma", "period", "slash", "space"),
    )
)
"""Keys that do nothing in a text field but type."""
_MODIFIER_OF: dict[int, Any] = {
    int(getattr(imgui.Key, side)): getattr(imgui.Key, modifier) for side, modifier in _MODIFIERS.items()
}
_ALT = frozenset({key.LALT, key.RALT})
_SHIFT = frozenset({int(imgui.Key.mod_shift)})
_BUTTONS = {mouse.LEFT: 0, mouse.RIGHT: 1, mouse.MIDDLE: 2, 8: 3, 16: 4}


class _ClipboardText(str):
    """Text whose len() counts UTF-8 bytes: pyglet's X11 clipboard cuts the text at len() bytes otherwise."""

    def __len__(self) -> int:
        return len(self.encode("utf-8"))


@dataclass(eq=False)
class KeyPress:
    """A key that went down, and the text that the same press types.

    Attributes:
        key: None for one that means nothing here but its text.
    """

    key: imgui.Key | None
    text: str = ""
    is_passed_on: bool = False


class ImGuiBackend:
    """Owns the ImGui and ImPlot contexts of one window.

    Args:
        window: A pyglet window whose GL context is current.
        on_input: Called after each event that was forwarded, so that the owner can plan a redraw.
        fixed_delta_s: Seconds per frame as reported to ImGui; None measures real time. Tests fix it.
        scale: How large everything is drawn.

    Attributes:
        pixels_per_unit: Of the newest frame. Everything that ImGui takes and gives is in units (ui.style.ui_scale).
        is_panel_keyed: Do arrow keys, Enter and Space move inside of a panel? Set before a frame.
        is_popup_open: Was a menu or another popup open when the newest frame began, or just before?
    """

    def __init__(
        self,
        window: BaseWindow,
        *,
        on_input: Callable[[], None] = lambda: None,
        fixed_delta_s: float | None = None,
        scale: UiScale | None = None,
    ) -> None:
        self._window = window
        self.scale = scale or UiScale()
        self.pixels_per_unit = 1.0
        self.is_popup_open = self.is_panel_keyed = False
        self._menu_frames = 0
        self._held_modifiers: set[int] = set()
        self._is_alt_alone = False
        self._was_alt_tapped = False
        self._on_input = on_input
        self._fixed_delta_s = fixed_delta_s
        self._last_frame_s = time.perf_counter()
        self._queue = InputQueue()
        self._newest_press: KeyPress | None = None
        self._pressed: dict[int, KeyPress] = {}
        self._shown_cursor = -2
        # On X11 and headless, rows count 0..height-1 upwards; Win32 and Cocoa report height - y.
        self._row_offset = 1.0 if (pyglet.options.headless or sys.platform.startswith("linux")) else 0.0

        self.context = imgui.create_context()
        self.plot_context = implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.set_log_filename("")
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.config_windows_move_from_title_bar_only = True
        io.backend_flags |= imgui.BackendFlags_.has_mouse_cursors
        imgui.backends.opengl3_init("#version 330")
        self._connect_clipboard()
        self._handlers: dict[str, Callable[..., Any]] = {
            "on_mouse_motion": self._mouse_motion,
            "on_mouse_drag": self._mouse_drag,
            "on_mouse_press": self._mouse_press,
            "on_mouse_release": self._mouse_release,
            "on_mouse_scroll": self._mouse_scroll,
            "on_mouse_enter": self._mouse_enter,
            "on_mouse_leave": self._mouse_leave,
            "on_key_press": self._key_press,
            "on_key_release": self._key_release,
            "on_text": self._text,
            "on_activate": self._activate,
            "on_deactivate": self._deactivate,
        }
        window.push_handlers(**self._handlers)

    # ---- one frame -------------------------------------------------------------------------------------------

    @property
    def needs_follow_up(self) -> bool:
        """True while input waits for the next frame: ImGui takes in what came at once one after the other."""
        return len(self._queue) > 0 or len(self.context.input_events_queue) > 0

    def take_alt_tap(self) -> bool:
        """Was Alt pressed and released with nothing between since this was last asked?"""
        was_tapped, self._was_alt_tapped = self._was_alt_tapped, False
        return was_tapped

    def new_frame(self) -> None:
        """Begin an ImGui frame sized to the window."""
        io = imgui.get_io()
        pixel_width, pixel_height = self._window.get_framebuffer_size()
        self.pixels_per_unit = self.scale.fitting(pixel_width, pixel_height)
        io.display_size = ImVec2(
            max(pixel_width, 1) / self.pixels_per_unit, max(pixel_height, 1) / self.pixels_per_unit
        )
        io.display_framebuffer_scale = ImVec2(self.pixels_per_unit, self.pixels_per_unit)
        self._offer_menu_keys()
        now_s = time.perf_counter()
        measured_s = now_s - self._last_frame_s
        self._last_frame_s = now_s
        io.delta_time = max(self._fixed_delta_s if self._fixed_delta_s is not None else measured_s, 1e-5)
        imgui.backends.opengl3_new_frame()
        imgui.new_frame()

    def _offer_menu_keys(self) -> None:
        """Arrow keys, Enter and Escape belong to a menu or popup while one is open, and to the shortcuts otherwise."""
        io = imgui.get_io()
        is_open = self._is_menu_open()
        # From one menu to the next by arrow key there are frames without any.
        self._menu_frames = FRAMES_BETWEEN_MENUS if is_open else max(self._menu_frames - 1, 0)
        self.is_popup_open = self._menu_frames > 0
        if self.is_popup_open or self.is_panel_keyed:
            io.config_flags |= imgui.ConfigFlags_.nav_enable_keyboard
        elif io.config_flags & imgui.ConfigFlags_.nav_enable_keyboard:
            io.config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
            imgui.set_nav_cursor_visible(False)

    def _is_menu_open(self) -> bool:
        is_in_bar = self.context.nav_layer == imgui.internal.NavLayer.menu and self.context.nav_cursor_visible
        return is_in_bar or len(self.context.open_popup_stack) > 0

    def end_frame(self) -> int:
        """Finish the frame; returns the fingerprint of its drawing (ui.shell.redraw)."""
        imgui.render()
        self._after_frame()
        return fingerprint(imgui.get_draw_data())

    def present(self) -> None:
        """Draw the finished frame into the bound framebuffer."""
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def _after_frame(self) -> None:
        is_closing = self._menu_frames > 0 and not self._is_menu_open()
        is_late = len(self.context.input_events_queue) > 0  # ImGui has not taken in all of its input
        # Else the next frame may give a field the keyboard, or the shortcuts their keys back.
        self._queue.after_frame(is_held=is_late or is_closing or self.context.nav_move_submitted)
        self._show_cursor()

    def close(self) -> None:
        """Take the handlers off the window and destroy both contexts. The GL context must still be current."""
        self._window.remove_handlers(**self._handlers)
        imgui.backends.opengl3_shutdown()
        implot.destroy_context(self.plot_context)
        imgui.destroy_context(self.context)

    # ---- events ----------------------------------------------------------------------------------------------

    def _pass_on(self, event: Callable[[], object]) -> None:
        """Report an event to ImGui, after those before it. True of an event asks for a frame before the next one."""
        self._newest_press = None
        self._queue.add(lambda: event() is True)
        self._on_input()

    def _move_to(self, x: float, y: float) -> None:
        width, height = self._window.get_size()
        units = self._window.get_framebuffer_size()[0] / max(width, 1) / self.pixels_per_unit
        imgui.get_io().add_mouse_pos_event(float(x) * units, float(height - self._row_offset - y) * units)

    def _mouse_motion(self, x: float, y: float, dx: float, dy: float) -> None:
        self._pass_on(lambda: self._move_to(x, y))

    def _mouse_drag(self, x: float, y: float, dx: float, dy: float, buttons: int, modifiers: int) -> None:
        self._pass_on(lambda: self._move_to(x, y))

    def _mouse_press(self, x: float, y: float, button: int, modifiers: int) -> None:
        self._pass_on(lambda: self._click(x, y, button, True))

    def _mouse_release(self, x: float, y: float, button: int, modifiers: int) -> None:
        self._pass_on(lambda: self._click(x, y, button, False))

    def _click(self, x: float, y: float, button: int, is_down: bool) -> None:
        self._is_alt_alone = False
        self._move_to(x, y)
        if button in _BUTTONS:
            imgui.get_io().add_mouse_button_event(_BUTTONS[button], is_down)

    def _mouse_scroll(self, x: float, y: float, scroll_x: float, scroll_y: float) -> None:
        def scroll() -> None:
            self._move_to(x, y)
            imgui.get_io().add_mouse_wheel_event(float(scroll_x), float(scroll_y))

        self._pass_on(scroll)

    def _mouse_enter(self, x: float, y: float) -> None:
        self._pass_on(lambda: self._move_to(x, y))

    def _mouse_leave(self, x: float, y: float) -> None:
        self._pass_on(lambda: imgui.get_io().add_mouse_pos_event(_FAR, _FAR))

    def _activate(self) -> None:
        self._pass_on(lambda: imgui.get_io().add_focus_event(True))

    def _deactivate(self) -> None:
        def lose_focus() -> None:
            self._held_modifiers.clear()
            self._is_alt_alone = False
            imgui.get_io().add_focus_event(False)

        self._forget_pressed(list(self._pressed))  # their releases go to another window
        self._pass_on(lose_focus)

    def _key_press(self, symbol: int, modifiers: int) -> bool | None:
        imgui_key = _KEY_MAP.get(symbol)
        press = KeyPress(imgui_key)
        if imgui_key is not None and int(imgui_key) not in _MODIFIER_OF:
            self._pressed[symbol] = press
        self._pass_on(lambda: self._press(symbol, press))
        self._newest_press = press
        # pyglet's own handler closes the window on Escape; this one comes first and keeps it open.
        return EVENT_HANDLED if symbol == key.ESCAPE else None

    def _press(self, symbol: int, press: KeyPress) -> bool:
        self._is_alt_alone = symbol in _ALT and not self._held_modifiers
        is_key = press.key is not None and not self._is_only_text(press.key)
        if press.key is not None and is_key:
            self._add_key(press.key, True)
        press.is_passed_on = True
        self._add_text(press.text)
        return is_key and int(press.key or 0) not in _MODIFIER_OF

    def _key_release(self, symbol: int, modifiers: int) -> None:
        released = self._released(symbol)
        if released or symbol in _ALT:
            self._pass_on(lambda: self._release(symbol, released))

    def _release(self, symbol: int, released: list[imgui.Key]) -> None:
        self._was_alt_tapped |= symbol in _ALT and self._is_alt_alone
        for imgui_key in released:
            self._add_key(imgui_key, False)

    def _released(self, symbol: int) -> list[imgui.Key]:
        """Keys that go up. The name of a key depends on Shift, which may have been released since it was pressed:
        under a name that was not pressed, the key of the same place goes up, else all of them."""
        imgui_key = _KEY_MAP.get(symbol)
        if imgui_key is not None and int(imgui_key) in _MODIFIER_OF:
            return [imgui_key]
        names = [symbol] if symbol in self._pressed else self._names_of(imgui_key) or list(self._pressed)
        return self._forget_pressed(names)

    def _names_of(self, imgui_key: imgui.Key | None) -> list[int]:
        return [name for name, press in self._pressed.items() if press.key == imgui_key]

    def _forget_pressed(self, symbols: list[int]) -> list[imgui.Key]:
        """Take keys as up; returns them. pyglet tells a press from a repetition by a list of its own."""
        getattr(self._window, "pressed_keys", set()).difference_update(symbols)
        return [pressed.key for pressed in map(self._pressed.pop, symbols) if pressed.key is not None]

    def _is_only_text(self, imgui_key: imgui.Key) -> bool:
        """Is this key of interest only for the character it types? ImGui takes in one key per frame but any number of
        characters: without this what is typed fast would appear slowly."""
        is_chord = bool(self._held_modifiers - _SHIFT)
        is_typing = imgui.get_io().want_text_input or self.context.want_text_input_next_frame == 1
        return is_typing and not is_chord and int(imgui_key) in _TYPING

    def _add_key(self, imgui_key: imgui.Key, is_down: bool) -> None:
        io = imgui.get_io()
        modifier = _MODIFIER_OF.get(int(imgui_key))
        if modifier is not None:
            (self._held_modifiers.add if is_down else self._held_modifiers.discard)(int(modifier))
            io.add_key_event(modifier, is_down)
        io.add_key_event(imgui_key, is_down)

    def _text(self, text: str) -> None:
        printable = "".join(character for character in text if character.isprintable())
        press, self._newest_press = self._newest_press, None
        if press is None:
            self._pass_on(lambda: self._add_text(printable))
        elif press.is_passed_on:  # the same frame takes it in: what the key opens does not begin with its letter
            self._add_text(printable)
        else:
            press.text = printable
        self._on_input()

    def _add_text(self, text: str) -> None:
        if text:
            imgui.get_io().add_input_characters_utf8(text)

    # ---- platform services -----------------------------------------------------------------------------------

    def _connect_clipboard(self) -> None:
        platform = imgui.get_platform_io()
        platform.platform_get_clipboard_text_fn = lambda _context: self._window.get_clipboard_text()
        platform.platform_set_clipboard_text_fn = lambda _context, text: self._window.set_clipboard_text(
            _ClipboardText(text)
        )

    def _show_cursor(self) -> None:
        wanted = int(imgui.get_mouse_cursor())
        if wanted == self._shown_cursor or pyglet.options.headless:
            return
        self._shown_cursor = wanted
        window = self._window
        names: dict[int, str | None] = {
            int(imgui.MouseCursor_.text_input): window.CURSOR_TEXT,
            int(imgui.MouseCursor_.resize_all): window.CURSOR_SIZE,
            int(imgui.MouseCursor_.resize_ns): window.CURSOR_SIZE_UP_DOWN,
            int(imgui.MouseCursor_.resize_ew): window.CURSOR_SIZE_LEFT_RIGHT,
            int(imgui.MouseCursor_.resize_nesw): window.CURSOR_SIZE_DOWN_LEFT,
            int(imgui.MouseCursor_.resize_nwse): window.CURSOR_SIZE_DOWN_RIGHT,
            int(imgui.MouseCursor_.hand): window.CURSOR_HAND,
        }
        name = names.get(wanted)
        window.set_mouse_cursor(None if name is None else window.get_system_mouse_cursor(name))
