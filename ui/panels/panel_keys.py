"""From panel to panel by keyboard. Usually the arrow keys, Enter, Space and Tab act on time and the view; once F6 went
to a panel they move inside of it, until Escape, a click, or F6 comes round to the picture.
"""

from __future__ import annotations

from collections.abc import Collection

from imgui_bundle import imgui

from ui.panels.actions.key import Key
from ui.panels.state import PANELS, UiState

_MOVES = frozenset(
    {"left_arrow", "right_arrow", "up_arrow", "down_arrow", "enter", "space", "tab", "escape", "home", "end"}
    | {"page_up", "page_down"}
)
"""Keys that belong to the panel: attributes of imgui.Key."""


def belongs_to_panel(key: Key, ui: UiState) -> bool:
    """Does the panel that F6 went to take this key?"""
    return ui.keyed_panel is not None and key.name in _MOVES and not key.is_ctrl and not key.is_alt


def step_panel(ui: UiState, in_front: Collection[str]) -> None:
    """Go where the user asked to go, and leave where the user left. Once per frame, before the panels are drawn.

    Args:
        in_front: Titles of the panels that are seen; no other one is brought to the front.
    """
    if ui.keyed_panel is not None and _is_left():
        ui.keyed_panel = None
    step, ui.wishes.panel_step = ui.wishes.panel_step, 0
    if not step or ui.is_picture_only:
        return
    order = (None, *(title for title in PANELS if title in in_front or title == ui.keyed_panel))
    ui.keyed_panel = order[(order.index(ui.keyed_panel) + step) % len(order)]
    ui.wanted_panel = ui.keyed_panel
    ui.redraw_within(0.0)


def _is_left() -> bool:
    is_clicked = any(imgui.is_mouse_clicked(button) for button in (0, 1, 2))
    is_escaped = imgui.is_key_pressed(imgui.Key.escape, False)
    return is_clicked or (is_escaped and not imgui.get_io().want_text_input)
