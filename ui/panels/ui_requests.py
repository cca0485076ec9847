"""Wishes: what actions, menus and the palette ask of the shell, which lies above them. They are taken up in the same
frame or in the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass
class UiRequests:
    """The request.

    Attributes:
        is_palette: Open the palette.
        preferences_page: Open the preferences at the page of this title; None for no wish, empty for the last one.
        is_read_only: Ask for a project to look at only.
        is_comparison: Ask for a project to compare the open one with.
        relocated_project: Ask where the capture of the project in this folder lies; None for no wish.
        is_calibration: Ask for a folder of plain videos to calibrate.
        is_fullscreen: Fill the screen, or go back to a window.
        layout: Name of the layout to show; None for no wish.
        is_layout_name: Ask for the name that the present layout is kept under.
        layout_removed: Name of a kept layout to forget; None for no wish.
        panel_step: Go to the next panel by keyboard, or with -1 to the one before; 0 for no wish.
        is_about: Say what the program is, and where its files are.
    """

    is_palette: bool = False
    preferences_page: str | None = None
    is_fullscreen: bool = False
    is_calibration: bool = False
    is_read_only: bool = False
    is_comparison: bool = False
    relocated_project: Path | None = None
    layout: str | None = None
    is_layout_name: bool = False
    layout_removed: str | None = None
    panel_step: int = 0
    is_about: bool = False
