"""The dialog for a project whose capture is not where it was: choose where it is now."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.session.commands import CloseQuestion, Command
from app.session.files.file_questions import RelocationQuestion
from app.session.projects.project_commands import OpenCapture
from ui.panels.pieces.widgets import primary_button
from ui.panels.state import UiState
from ui.style import theme
from ui.style.theme import Icon

BUTTON = ImVec2(170, 34)


def relocation_texts(question: RelocationQuestion) -> list[str]:
    """Text of the dialog, paragraph by paragraph."""
    texts = [f"The capture of this project is no longer at {question.capture}."]
    if question.refused is not None:
        texts.append(
            f"{question.refused} holds another capture: its pictures or cameras do not match this project. Choose "
            "another folder, or open that capture as its own project."
        )
    return [*texts, "Choose the folder where it is now. Training and edits are kept."]


def draw_relocation(question: RelocationQuestion, ui: UiState, is_agreed: bool) -> Command | None:
    """Draw it. is_agreed: Enter was pressed. Returns the answer, if there is one."""
    for text in relocation_texts(question):
        if question.refused is not None and text.startswith(str(question.refused)):
            imgui.text_colored(theme.ORANGE, Icon.WARNING)
            imgui.same_line()
        imgui.text(text)
        imgui.spacing()
    imgui.text_disabled(f"Project: {question.project}")
    imgui.separator()
    imgui.spacing()
    if question.refused is not None:
        if imgui.button("Open that capture", BUTTON):
            return OpenCapture(question.refused, is_asking=True)
        ui.mark("question.other")
        imgui.same_line()
    imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 20)
    if primary_button("Choose folder ...", BUTTON, ui) or is_agreed:
        ui.wishes.relocated_project = question.project
        return CloseQuestion()
    ui.mark("question.yes")
    imgui.same_line()
    is_cancelled = imgui.button("Cancel", BUTTON)
    ui.mark("question.no")
    return CloseQuestion() if is_cancelled else None
