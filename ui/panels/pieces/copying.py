"""Copy as command: entries of menus that put what was done, or can be done, onto the clipboard as text."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from imgui_bundle import imgui

from app.command_text.command_text import CommandText
from engine.errors import EngineError
from ui.panels.state import UiState
from ui.style.theme import Icon

COMMAND, PYTHON = "Copy as command", "Copy as Python"


def copy_command(make: Callable[[], CommandText]) -> None:
    """Copy the line for a terminal; a command without such a line leaves the clipboard as it is."""
    with suppress(EngineError):
        imgui.set_clipboard_text(make().shell())


def copy_python(make: Callable[[], CommandText]) -> None:
    """Copy the lines for a script; a command without such lines leaves the clipboard as it is."""
    with suppress(EngineError):
        imgui.set_clipboard_text(make().python)


def draw_copy_menu(ui: UiState, name: str, make: Callable[[], CommandText]) -> None:
    """The same inside a menu of their own."""
    if imgui.begin_menu(f"{Icon.COPY}  {COMMAND}###copy"):
        draw_copy_entries(ui, name, make)
        imgui.end_menu()
    else:
        ui.mark(f"{name}.copy")


def draw_copy_entries(ui: UiState, name: str, make: Callable[[], CommandText], *, is_enabled: bool = True) -> None:
    """Two entries of a menu.

    Args:
        name: In front of their names in ui.rects.
        make: The text; called where it is wanted.
    """
    if imgui.menu_item(f"{Icon.COPY}  {COMMAND}", "", False, is_enabled)[0]:
        copy_command(make)
    ui.mark(f"{name}.copy command")
    imgui.set_item_tooltip("A command line that does the same to this project")
    if imgui.menu_item(f"{Icon.COPY}  {PYTHON}", "", False, is_enabled)[0]:
        copy_python(make)
    ui.mark(f"{name}.copy python")
