"""Gestures: functions of the mouse's buttons and wheel over the picture, as one table per preset.

A preset is chosen, never guessed: a wheel and a touchpad cannot be distinguished by what they send.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Gesture = Literal["orbit", "pan", "dolly", "look", "roll", "lens", "none"]
Button = Literal["Left", "Middle", "Right"]

GESTURE_WORDS: dict[str, str] = {
    "orbit": "Orbit around what is under the pointer",
    "pan": "Move the view sideways",
    "dolly": "Move nearer or farther",
    "look": "Look around",
    "roll": "Roll the view",
    "lens": "Field of view",
}
DEFAULT_PRESET = "studio"
FLY_KEYS: dict[str, tuple[float, float, float]] = {
    "w": (0.0, 0.0, 1.0),
    "s": (0.0, 0.0, -1.0),
    "a": (-1.0, 0.0, 0.0),
    "d": (1.0, 0.0, 0.0),
    "e": (0.0, 1.0, 0.0),
    "q": (0.0, -1.0, 0.0),
}
"""To the right, up and ahead, for keys that are held."""


@dataclass(frozen=True, slots=True)
class Preset:
    """Functions of a mouse.

    Attributes:
        name: In preferences.
        label: As shown to the user.
        drags: Gesture by button and modifiers, for example ("Left", "Ctrl+Alt"). With modifiers that are not in it a
            button does what it does without any.
        wheel: Gesture by modifiers, likewise.
        look_button: The button that looks around while one flies.
    """

    name: str
    label: str
    drags: dict[tuple[Button, str], Gesture]
    wheel: dict[str, Gesture]
    look_button: Button = "Left"

    @property
    def title(self) -> str:
        """The label without its explanation."""
        return self.label.partition(":")[0]

    def drag(self, button: Button, modifiers: str, *, is_flying: bool = False) -> Gesture:
        """The gesture of dragging with a button."""
        if is_flying and button == self.look_button:
            return "look"
        return self.drags.get((button, modifiers), self.drags.get((button, ""), "none"))

    def turn(self, modifiers: str) -> Gesture:
        """The gesture of turning the wheel."""
        return self.wheel.get(modifiers, self.wheel[""])


_MIDDLE: dict[tuple[Button, str], Gesture] = {
    ("Middle", ""): "orbit",
    ("Middle", "Shift"): "pan",
    ("Middle", "Ctrl"): "dolly",
}
_BOTH: dict[tuple[Button, str], Gesture] = {
    ("Left", ""): "orbit",
    ("Right", ""): "pan",
    **_MIDDLE,
    ("Right", "Shift"): "look",
    ("Left", "Ctrl+Alt"): "roll",
}
_WHEEL: dict[str, Gesture] = {"": "dolly", "Shift": "pan", "Ctrl": "lens"}

PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset("studio", "Studio", _BOTH, _WHEEL),
        Preset(
            "blender",
            "Blender: the middle button orbits",
            {**_MIDDLE, ("Left", "Alt"): "orbit", ("Right", "Shift"): "look", ("Middle", "Ctrl+Alt"): "roll"},
            _WHEEL,
            look_button="Right",
        ),
        Preset("supersplat", "SuperSplat: the right button looks around while flying", _BOTH, _WHEEL, "Right"),
        Preset(
            "touchpad",
            "Touchpad: two fingers orbit, pinching zooms",
            _BOTH,
            {"": "orbit", "Shift": "pan", "Ctrl": "dolly", "Ctrl+Shift": "lens"},
        ),
    )
}
"""By name; the first one is that of a new user."""


@dataclass
class Navigation:
    """How the user wants to move about; the same in all projects.

    Attributes:
        preset_name: One of PRESETS; another one counts as the default.
        is_motion_reduced: Whether the view jumps instead of moving.
    """

    preset_name: str = DEFAULT_PRESET
    is_motion_reduced: bool = False

    @property
    def preset(self) -> Preset:
        """The table in use."""
        return PRESETS.get(self.preset_name, PRESETS[DEFAULT_PRESET])


def modifier_words(*, is_ctrl: bool, is_shift: bool, is_alt: bool) -> str:
    """Modifiers as the tables write them, for example "Ctrl+Shift"; empty without any."""
    held = (("Ctrl", is_ctrl), ("Shift", is_shift), ("Alt", is_alt))
    return "+".join(word for word, is_held in held if is_held)


def gesture_rows(preset: Preset) -> tuple[tuple[str, str], ...]:
    """Gestures and their effects, a row each; similar ones next to each other."""
    wheel = "Two fingers" if preset.name == "touchpad" else "Wheel"
    done = [(f"{button} drag", modifiers, gesture) for (button, modifiers), gesture in preset.drags.items()]
    done += [(wheel, modifiers, gesture) for modifiers, gesture in preset.wheel.items()]
    done.append((f"{preset.look_button} drag", "Flying", "look"))
    order = list(GESTURE_WORDS)
    return tuple(
        (_chord(modifiers, what), GESTURE_WORDS[gesture])
        for what, modifiers, gesture in sorted(done, key=lambda row: order.index(row[2]))
    )


def mouse_help(preset: Preset) -> tuple[tuple[str, str], ...]:
    """Rows of the help sheet on everything that is done by mouse, or with keys that are held."""
    return (
        *gesture_rows(preset),
        ("W A S D, Q E", "Fly, with Q down and E up; Shift is faster, Alt slower"),
        ("Double click", "Centre the view on what is under the pointer"),
        ("Axes, top right", "A click looks along an axis, a drag orbits"),
        ("Click, wheel", "While placing a region: set its position, change its size (Ctrl + wheel moves the view)"),
        ("Camera click", "Look through that camera"),
        ("Timeline drag", "Move through time"),
        ("White line drag", "Wipe between the two compared pictures"),
        ("Hold B", "Show only the picture that the render is compared with"),
        ("Timeline wheel", "Scroll (also middle drag); with Ctrl, zoom; double-click shows everything"),
        ("Seam click", "Play around the boundary between two clips"),
        ("Folder drop", "Open the capture or project; a new capture first asks a few questions"),
    )


def _chord(modifiers: str, what: str) -> str:
    return f"{modifiers} + {what[0].lower()}{what[1:]}".replace("+", " + ").replace("  ", " ") if modifiers else what
