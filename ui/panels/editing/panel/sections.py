"""Parts of the panel Edit: bringing one into sight, and headers that are folded away until their tool is in use."""

from __future__ import annotations

from imgui_bundle import imgui

from ui.panels.state import EDIT_SECTIONS, UiState

TALL = 480.0
"""In a panel so high, units, there is room for what could be shorter."""


def reach_section(ui: UiState, name: str) -> bool:
    """At the beginning of a part: scroll there where the user asked for it. Returns whether that was so."""
    is_wanted = ui.editing.wanted_section == name
    if is_wanted:
        ui.editing.wanted_section = ""
        imgui.set_scroll_here_y(0.0)
        ui.redraw_within(0.0)  # the panel scrolls in the next frame
    return is_wanted


def section_header(ui: UiState, name: str, *, is_used: bool = False, is_open_first: bool = False) -> bool:
    """A header that unfolds when it is clicked or asked for, or what is under it begins to be used.

    Args:
        name: One of EDIT_SECTIONS.
        is_used: Whether what is under it is in use now.
        is_open_first: Whether it begins unfolded.
    Returns:
        Whether it is unfolded.
    """
    is_wanted, was_used = reach_section(ui, name), name in ui.editing.used_sections
    if is_wanted or (is_used and not was_used):
        imgui.set_next_item_open(True)
    (ui.editing.used_sections.add if is_used else ui.editing.used_sections.discard)(name)
    flags = imgui.TreeNodeFlags_.default_open if is_open_first else imgui.TreeNodeFlags_.none
    is_open = imgui.collapsing_header(f"{EDIT_SECTIONS[name]}##{name}", flags)
    ui.mark(f"edits.{name}")
    return is_open
