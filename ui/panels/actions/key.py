"""Keys as text, for example "Ctrl+Shift+Z": what tables and preferences hold, and what ImGui is asked."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import imgui

_NAMES = {
    "Space": "space",
    "Left": "left_arrow",
    "Right": "right_arrow",
    "Up": "up_arrow",
    "Down": "down_arrow",
    "Page Up": "page_up",
    "Page Down": "page_down",
    "[": "left_bracket",
    "]": "right_bracket",
    "\\": "backslash",
    ",": "comma",
    ".": "period",
    "/": "slash",
    "-": "minus",
    "+": "equal",
    **{f"Num {digit}": f"keypad{digit}" for digit in range(10)},
    "Num .": "keypad_decimal",
}
"""Keys whose name is not the printed word in lower case."""
_ANY_SHIFT = ("-", "+", "0")
"""With Ctrl or alone these are pressed with Shift on some keyboards, without it on others."""
_MODIFIERS = ("Ctrl", "Shift", "Alt")


@dataclass(frozen=True, slots=True)
class Key:
    """A key with its exact modifiers.

    Attributes:
        label: As printed, for example "Ctrl+Left".
        name: Attribute of imgui.Key.
        is_any_shift: With Shift or without.
    """

    label: str
    name: str
    is_ctrl: bool = False
    is_shift: bool = False
    is_alt: bool = False
    is_any_shift: bool = False

    @property
    def chord(self) -> tuple[str, bool, bool, bool]:
        """Identity: equal for two keys that are pressed in the same way."""
        return self.name, self.is_ctrl, self.is_shift, self.is_alt

    def collides(self, other: Key) -> bool:
        """Can one press be both?"""
        if (self.name, self.is_ctrl, self.is_alt) != (other.name, other.is_ctrl, other.is_alt):
            return False
        return self.is_any_shift or other.is_any_shift or self.is_shift == other.is_shift

    def is_pressed(self, *, repeats: bool) -> bool:
        """Was it pressed since the last frame? repeats: Or held so long that it repeats."""
        io = imgui.get_io()
        if self.is_ctrl != io.key_ctrl or self.is_alt != io.key_alt:
            return False
        if not self.is_any_shift and self.is_shift != io.key_shift:
            return False
        return imgui.is_key_pressed(getattr(imgui.Key, self.name), repeats)


def parse_key(label: str) -> Key:
    """Raises ValueError where the text does not name a key.

    Args:
        label: Modifiers and a key, joined by plus signs; "Ctrl++" is Ctrl and plus.
    """
    rest, modifiers = label, set()
    while True:
        modifier = next(
            (word for word in _MODIFIERS if rest.startswith(f"{word}+") and len(rest) > len(word) + 1), None
        )
        if modifier is None or modifier in modifiers:
            break
        modifiers.add(modifier)
        rest = rest[len(modifier) + 1 :]
    name = _NAMES.get(rest, f"_{rest}" if len(rest) == 1 and rest.isdigit() else rest.lower())
    if not rest or not isinstance(getattr(imgui.Key, name, None), imgui.Key):
        raise ValueError(f"'{label}' does not name a key")
    is_any_shift = rest in _ANY_SHIFT and "Shift" not in modifiers
    return Key(label, name, "Ctrl" in modifiers, "Shift" in modifiers, "Alt" in modifiers, is_any_shift)


def pressed_label() -> str:
    """The key that was pressed since the last frame with the modifiers held, as `parse_key` reads it; else empty.

    A modifier alone does not count as one.
    """
    io = imgui.get_io()
    for name, printed in _PRINTED.items():
        if imgui.is_key_pressed(getattr(imgui.Key, name), False):
            is_shift = io.key_shift and printed not in _ANY_SHIFT
            held = (("Ctrl", io.key_ctrl), ("Shift", is_shift), ("Alt", io.key_alt))
            return "+".join([*(word for word, is_held in held if is_held), printed])
    return ""


def _printed_names() -> dict[str, str]:
    names = {letter.lower(): letter for letter in "ABCDEFGHIJKLMNOPQRSTUVWXYZ"}
    names |= {f"_{digit}": str(digit) for digit in range(10)}
    names |= {f"f{number}": f"F{number}" for number in range(1, 13)}
    names |= {word.lower(): word for word in ("Home", "End", "Insert", "Delete", "Enter", "Tab", "Backspace", "Escape")}
    return names | {name: label for label, name in _NAMES.items()}


_PRINTED = _printed_names()
"""By the attribute of imgui.Key, how the key is printed."""
