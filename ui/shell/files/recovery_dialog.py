"""The dialog for a project whose document or journal is damaged: the fault, and three ways to continue."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.document.storing.recovery import Recovery
from app.project.opening.project_choices import ProjectChoices
from app.session.commands import CloseQuestion, Command
from app.session.files.file_commands import ShowProjectFolder
from app.session.files.file_questions import RecoveryQuestion
from app.session.projects.project_commands import OpenProject
from ui.panels.pieces.widgets import primary_button
from ui.panels.state import UiState
from ui.style import theme
from ui.style.theme import Icon

ROW_HEIGHT = 62.0
BUTTON = ImVec2(170, 34)


@dataclass(frozen=True, slots=True)
class Way:
    """One way to continue.

    Attributes:
        title, detail: Its name and its consequences.
        command: The command sent for it.
    """

    title: str
    detail: str
    command: Command


def ways(recovery: Recovery) -> list[Way]:
    """The ways that there are, the best first."""
    found = []
    folder = recovery.folder
    if recovery.step is not None:
        last = f', the last of them "{recovery.step_name}"' if recovery.step_name else ""
        source = "the backup of the project file" if recovery.is_from_backup else "the project file"
        steps = f"{recovery.n_replayed} step{'' if recovery.n_replayed == 1 else 's'} of the journal{last}"
        follow = f" and {steps}" if recovery.n_replayed else ""
        title = f"{Icon.UNDO}  Continue with all that can be read, up to step {recovery.step}"
        detail = f"Read from {source}{follow}. Damaged files are kept in the project folder."
        found.append(Way(title, detail, OpenProject(folder, ProjectChoices(is_repaired=True))))
    if recovery.plain_step is not None:
        title = f"{Icon.EYE}  Open read-only as of step {recovery.plain_step}"
        detail = "The journal is ignored, and nothing can be edited or trained."
        found.append(Way(title, detail, OpenProject(folder, ProjectChoices(is_journal_used=False))))
    title = f"{Icon.FOLDER}  Change nothing, and show the folder"
    detail = "To restore the damaged file from a backup. Clips are separate files and not affected."
    found.append(Way(title, detail, ShowProjectFolder(folder)))
    return found


class RecoveryDialog:
    """Owns which way is chosen."""

    def __init__(self) -> None:
        self._chosen = 0

    def reset(self) -> None:
        """Another question: the first way is chosen."""
        self._chosen = 0

    def draw(self, question: RecoveryQuestion, ui: UiState, is_agreed: bool) -> Command | None:
        """Draw it. is_agreed: Enter was pressed. Returns the answer, if there is one."""
        found = ways(question.recovery)
        imgui.text_colored(theme.ORANGE, Icon.WARNING)
        imgui.same_line()
        imgui.text(question.recovery.problem)
        imgui.text_disabled(str(question.recovery.folder))
        imgui.spacing()
        step = imgui.is_key_pressed(imgui.Key.down_arrow) - imgui.is_key_pressed(imgui.Key.up_arrow)
        self._chosen = (self._chosen + step) % len(found)
        answer = None
        for index, way in enumerate(found):
            if self._draw_way(index, way, ui):
                answer = way.command
        imgui.spacing()
        imgui.separator()
        imgui.spacing()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 20)
        if primary_button("Continue", BUTTON, ui) or is_agreed:
            answer = found[self._chosen].command
        ui.mark("question.yes")
        imgui.same_line()
        if imgui.button("Cancel", BUTTON):
            answer = CloseQuestion()
        ui.mark("question.no")
        return answer

    def _draw_way(self, index: int, way: Way, ui: UiState) -> bool:
        """A row: title and its consequences. True when it is taken by a double click."""
        start, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
        flags = imgui.SelectableFlags_.allow_double_click | imgui.SelectableFlags_.no_auto_close_popups
        is_clicked = imgui.selectable(f"##way{index}", index == self._chosen, flags, ImVec2(width, ROW_HEIGHT))[0]
        ui.mark(f"question.way{index}")
        end = imgui.get_cursor_pos()
        if is_clicked:
            self._chosen = index
        imgui.set_cursor_pos(ImVec2(start.x + 10, start.y + 4))
        imgui.text(way.title)
        imgui.set_cursor_pos(ImVec2(start.x + 36, start.y + 24))
        imgui.push_text_wrap_pos(start.x + width - 8)
        imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))
        imgui.text(way.detail)
        imgui.pop_style_color()
        imgui.pop_text_wrap_pos()
        imgui.set_cursor_pos(end)
        imgui.dummy(ImVec2(0, 0))
        return is_clicked and imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
