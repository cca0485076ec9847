"""The dialog that asks with which preset training starts over, and says what that discards."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.session.commands import CloseQuestion, Command
from app.session.projects.project_commands import NewProject, StartOver
from app.session.questions import StartOverQuestion
from ui.panels.pieces.widgets import primary_button, text_wrapped, text_wrapped_dim
from ui.panels.state import UiState
from ui.style import theme
from ui.style.theme import Icon

BUTTON_HEIGHT = 34.0
PRESET_WIDTH = 150.0
KEPT = "Camera paths, markers, regions and edits stay; edits of single Gaussians lose their targets."


class StartOverDialog:
    """Owns which preset is chosen until it is answered."""

    def __init__(self) -> None:
        self._asked: StartOverQuestion | None = None
        self._preset = ""

    def draw(self, question: StartOverQuestion, ui: UiState, is_agreed: bool) -> Command | None:
        """Words, a choice of presets and buttons. is_agreed: Enter was pressed."""
        if question is not self._asked and not question.is_working:
            self._preset = question.preset
        self._asked = question
        if question.is_working:
            text_wrapped("Deleting trained clips ...")
            ui.redraw_within(0.1)
            return None
        if question.discards:
            imgui.text_colored(theme.ORANGE, Icon.WARNING)
            imgui.same_line()
            text_wrapped(f"This discards {question.discards}. This cannot be undone.")
        else:
            text_wrapped("Nothing is trained yet, so nothing is discarded.")
        ui.mark("question.discards")
        imgui.spacing()
        text_wrapped_dim(KEPT)
        imgui.spacing()
        imgui.set_next_item_width(PRESET_WIDTH)
        if imgui.begin_combo("Preset", self._preset):
            for name in question.presets:
                if imgui.selectable(name, name == self._preset)[0]:
                    self._preset = name
                ui.mark(f"question.preset.{name}")
            imgui.end_combo()
        ui.mark("question.preset")
        imgui.spacing()
        return self._draw_buttons(ui, is_agreed)

    def _draw_buttons(self, ui: UiState, is_agreed: bool) -> Command | None:
        answer: Command | None = StartOver(self._preset) if is_agreed else None
        imgui.separator()
        imgui.spacing()
        width = (imgui.get_content_region_avail().x - 16) / 3
        size = ImVec2(width, BUTTON_HEIGHT)
        if primary_button("Start over", size, ui):
            answer = StartOver(self._preset)
        ui.mark("question.yes")
        imgui.same_line(0, 8)
        if imgui.button("New project", size):
            answer = NewProject()
        ui.mark("question.other")
        imgui.set_item_tooltip("Another project of this capture; this one does not change")
        imgui.same_line(0, 8)
        if imgui.button("Cancel", size):
            answer = CloseQuestion()
        ui.mark("question.no")
        return answer
