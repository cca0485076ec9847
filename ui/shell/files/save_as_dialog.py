"""The dialog that asks where a copy of the open project is to be made, and the one that is up meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.session.commands import CloseQuestion, Command
from app.session.files.file_commands import CancelSaveAs, SaveProjectAs
from app.session.files.file_questions import SAVING, SaveAsQuestion, SavingQuestion
from app.status import JobStatus
from ui.panels.pieces.widgets import primary_button
from ui.panels.state import UiState
from ui.style import theme
from ui.style.theme import Icon

BUTTON = ImVec2(170, 34)


class SaveAsDialog:
    """Owns the typed text."""

    def __init__(self) -> None:
        self._text = ""
        self._looked: tuple[str, str] = ("", "")
        self._is_keyboard_wanted = False

    def reset(self, question: SaveAsQuestion) -> None:
        """Another question: its suggestion stands there."""
        self._text, self._looked = str(question.suggestion), ("", "")
        self._is_keyboard_wanted = True

    def draw(self, question: SaveAsQuestion, ui: UiState, is_agreed: bool) -> Command | None:
        """Draw it. is_agreed: Enter was pressed. Returns the answer, if there is one."""
        imgui.text("Folder of the copy:")
        if self._is_keyboard_wanted:
            self._is_keyboard_wanted = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        is_entered, self._text = imgui.input_text("##folder", self._text, imgui.InputTextFlags_.enter_returns_true)
        ui.mark("question.folder")
        why_not = self._why_not()
        if why_not:
            imgui.text_colored(theme.ORANGE, f"{Icon.WARNING}  {why_not}")
        else:
            size = (
                f"It takes {question.n_bytes / 1e6:.0f} MB at most: finished clips are shared where the disk allows it."
            )
            imgui.text_disabled(size)
        imgui.text_disabled("The copy is opened; the present project does not change.")
        imgui.separator()
        imgui.spacing()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 20)
        imgui.begin_disabled(bool(why_not))
        is_clicked = primary_button("Save", BUTTON, ui)
        imgui.end_disabled()
        ui.mark("question.yes")
        imgui.same_line()
        is_cancelled = imgui.button("Cancel", BUTTON)
        ui.mark("question.no")
        if (is_clicked or is_entered or is_agreed) and not why_not:
            return SaveProjectAs(Path(self._text).expanduser())
        return CloseQuestion() if is_cancelled else None

    def _why_not(self) -> str:
        """Why the typed folder cannot be taken; asks the disk only when something else was typed."""
        if self._looked[0] != self._text or not self._text:
            self._looked = (self._text, unfit_folder(self._text))
        return self._looked[1]


def unfit_folder(text: str) -> str:
    """Why a copy cannot be made in the folder that a text names; empty where it can."""
    try:
        folder = Path(text).expanduser()
        if not text.strip() or not folder.is_absolute():
            return "Enter the full path of a folder."
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            return "This name is already taken."
    except (OSError, RuntimeError, ValueError):
        return "This is not a valid folder name."
    return ""


def draw_saving(question: SavingQuestion, jobs: Sequence[JobStatus], ui: UiState) -> Command | None:
    """Draw how far the copy is. Returns the wish to end it, if there is one."""
    imgui.text(str(question.folder))
    job = next((job for job in jobs if job.name == SAVING), JobStatus(SAVING, 1.0))
    imgui.progress_bar(job.done, ImVec2(-1, 20), f"{100 * job.done:.0f} %")
    imgui.text_disabled(job.message)
    imgui.spacing()
    imgui.set_cursor_pos_x(imgui.get_window_width() - BUTTON.x - 12)
    is_cancelled = imgui.button("Cancel", BUTTON)
    ui.mark("question.no")
    ui.redraw_within(0.1)
    return CancelSaveAs() if is_cancelled else None
