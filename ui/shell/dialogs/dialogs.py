"""Asking for a folder without stopping the frame loop.

The desktop's own dialog is used where its helper program is installed; elsewhere a small path box with a folder list.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

from imgui_bundle import ImVec2, imgui
from imgui_bundle import portable_file_dialogs as native

from app.project.opening.project_choices import ProjectChoices
from app.session.captures.capture_commands import LookAtVideos
from app.session.projects.project_commands import OpenCapture, OpenProject
from app.session.showing.look_commands import CompareProject
from engine.importing.suffixes import is_scene_file
from ui.panels.state import Dispatch, UiState
from ui.style import theme

_LINUX_HELPERS = ("zenity", "kdialog", "matedialog", "qarma")
OPEN, CALIBRATE, READ_ONLY, RELOCATE, COMPARE = "open", "calibrate", "read only", "relocate", "compare"
"""Purposes of asking for a folder."""
_TITLES = {
    OPEN: "Open a capture or project folder",
    CALIBRATE: "Calibrate a folder of plain videos",
    READ_ONLY: "Open a project read-only",
    RELOCATE: "Choose the capture of this project",
    COMPARE: "Compare with another project",
}
_HINTS = {
    OPEN: "Folder with the cameras, or of a project; or a file of Gaussians, such as .4dgs or .ply",
    CALIBRATE: "Folder with one video, or one folder of pictures, per camera",
    READ_ONLY: "Folder of a project, or of a capture that has one; nothing in it is changed",
    RELOCATE: "Folder with the cameras and their videos or pictures",
    COMPARE: "Folder of a project; or a file of Gaussians, or a folder of them, which is imported",
}
_MAX_LISTED = 500


def has_native_dialog() -> bool:
    """Can this desktop show its own folder dialog? Without a helper it would look like Cancel."""
    if not sys.platform.startswith("linux"):
        return True
    return any(shutil.which(program) for program in _LINUX_HELPERS)


def list_folders(folder: Path) -> list[str]:
    """Names of the visible subfolders, sorted; empty when the folder cannot be read."""
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")]
    except OSError:
        return []
    return sorted(names, key=str.lower)[:_MAX_LISTED]


def typed_path(text: str) -> Path | None:
    """The path that a text names; None where it is empty or cannot be one: too long, a home that nobody has."""
    if not text.strip():
        return None
    try:
        path = Path(text).expanduser()
        path.is_dir()
    except (OSError, RuntimeError, ValueError):
        return None
    return path


class OpenFolderDialog:
    """One question for a folder: native when possible, else drawn. Owns the running question only."""

    def __init__(self, start: Path | None = None) -> None:
        self._start = (start or Path.home()).resolve()
        self._native: Any = None
        self._is_box_wanted = False
        self._is_keyboard_wanted = False
        self._text = str(self._start)
        self._listed: tuple[str, list[str]] = ("", [])
        self._purpose = OPEN
        self._project: Path | None = None

    @property
    def is_waiting(self) -> bool:
        """True while the desktop's dialog is up and has to be polled."""
        return self._native is not None

    def open_wished(self, ui: UiState) -> None:
        """Ask for what is wished, if anything is."""
        wishes = ui.wishes
        if wishes.relocated_project is not None:
            self.open(purpose=RELOCATE, project=wishes.relocated_project)
        elif wishes.is_comparison:
            self.open(purpose=COMPARE)
        elif wishes.is_read_only or wishes.is_calibration or ui.is_open_requested:
            self.open(purpose=READ_ONLY if wishes.is_read_only else CALIBRATE if wishes.is_calibration else OPEN)
        wishes.relocated_project = None
        ui.is_open_requested = wishes.is_calibration = wishes.is_read_only = False
        wishes.is_comparison = False

    def open(self, start: Path | None = None, *, purpose: str = OPEN, project: Path | None = None) -> None:
        """Ask, for one of the purposes above. A second call while a question is up does nothing.

        Args:
            project: The project whose capture is asked for.
        """
        if self._native is not None:
            return
        self._purpose, self._project = purpose, project
        if start is not None:
            self._start = start
            self._text = str(start)
        if has_native_dialog():
            self._native = native.select_folder(_TITLES[self._purpose], str(self._start))
        else:
            self._is_box_wanted = True

    def draw(self, dispatch: Dispatch, ui: UiState) -> None:
        """Poll the desktop's dialog or draw our own; dispatches a command on an answer."""
        if self._native is not None:
            self._poll_native(dispatch, ui)
        if self._is_box_wanted:
            self._is_box_wanted = False
            self._is_keyboard_wanted = True
            imgui.open_popup(self._popup)
        center = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(center, imgui.Cond_.appearing, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(620, 420), imgui.Cond_.appearing)
        is_open, _ = imgui.begin_popup_modal(self._popup, True, imgui.WindowFlags_.no_saved_settings)
        if is_open:
            self._draw_box(dispatch, ui)
            imgui.end_popup()

    @property
    def _popup(self) -> str:
        return f"{_TITLES[self._purpose]}###folder"

    def _answer(self, folder: Path) -> OpenCapture | OpenProject | LookAtVideos | CompareProject:
        if self._purpose == RELOCATE and self._project is not None:
            return OpenProject(self._project, ProjectChoices(capture=folder))
        if self._purpose == COMPARE:
            return CompareProject(folder)
        if self._purpose == READ_ONLY:
            return OpenCapture(folder, choices=ProjectChoices(is_read_only=True))
        return LookAtVideos(folder) if self._purpose == CALIBRATE else OpenCapture(folder, is_asking=True)

    def _poll_native(self, dispatch: Dispatch, ui: UiState) -> None:
        if not self._native.ready(0):
            ui.redraw_within(0.1)
            return
        answer, self._native = self._native.result(), None
        if answer:
            self._start = Path(answer)
            dispatch(self._answer(Path(answer)))

    def _draw_box(self, dispatch: Dispatch, ui: UiState) -> None:
        imgui.text_disabled(_HINTS[self._purpose])
        if self._is_keyboard_wanted:
            self._is_keyboard_wanted = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        is_entered, self._text = imgui.input_text("##path", self._text, flags)
        ui.mark("open.path")
        folder = typed_path(self._text)
        is_folder = folder is not None and folder.is_dir()
        is_scene = folder is not None and self._purpose in (OPEN, COMPARE) and is_scene_file(folder)
        if imgui.begin_child("folders", ImVec2(0, -46), imgui.ChildFlags_.borders):
            self._draw_folders(self._start if folder is None else folder if is_folder else folder.parent)
        imgui.end_child()
        if not (is_folder or is_scene):
            imgui.align_text_to_frame_padding()
            imgui.text_colored(theme.ORANGE, f"{theme.Icon.WARNING}  There is no such folder")
            imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 252)
        if imgui.button("Cancel", ImVec2(110, 0)):
            imgui.close_current_popup()
        imgui.same_line()
        imgui.begin_disabled(not (is_folder or is_scene))
        is_clicked = imgui.button("Open" if self._purpose in (OPEN, READ_ONLY) else "Continue", ImVec2(120, 0))
        ui.mark("open.accept")
        imgui.end_disabled()
        if (is_clicked or is_entered) and folder is not None and (is_folder or is_scene):
            self._start = folder if is_folder else folder.parent
            dispatch(self._answer(folder))
            imgui.close_current_popup()
        elif imgui.is_key_pressed(imgui.Key.escape, False):
            imgui.close_current_popup()

    def _draw_folders(self, folder: Path) -> None:
        if self._listed[0] != str(folder):
            self._listed = (str(folder), list_folders(folder))
        if folder.parent != folder and imgui.selectable(f"{theme.Icon.FOLDER}  ..", False)[0]:
            self._text = str(folder.parent)
        for name in self._listed[1]:
            if imgui.selectable(f"{theme.Icon.FOLDER}  {name}", False)[0]:
                self._text = str(folder / name)
