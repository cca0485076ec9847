"""Where an export goes, and its size: the lower part of the export dialog."""

from __future__ import annotations

from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui
from imgui_bundle import portable_file_dialogs as native

from app.export.export_choices import ExportChoices
from app.export.export_plan import ExportPlan
from app.session.session_view import ExportingView
from ui.panels.exports import bytes_text, files_text
from ui.panels.pieces.widgets import text_wrapped, text_wrapped_dim
from ui.panels.state import UiState
from ui.shell.dialogs.dialogs import has_native_dialog
from ui.style import theme
from ui.style.theme import Icon

LABEL_WIDTH = 130.0
REFRESH_S = 0.1


class ExportPlace:
    """The field with the file or folder. Another kind or format gets another name, unless the user has typed one.

    Attributes:
        is_looking: Whether a name is looked for just now, so that nothing can be said of the one that stands there.
    """

    def __init__(self) -> None:
        self.is_looking = False
        self._suggested = ""
        self._native: Any = None
        self._has_native = False

    def begin(self, choices: ExportChoices) -> None:
        """A dialog is opened with these."""
        self._suggested, self.is_looking = choices.out, not choices.out
        self._has_native = has_native_dialog()

    def suggested(self, exporting: ExportingView, before: ExportChoices, now: ExportChoices) -> ExportChoices:
        """The choices with another name, where they have changed so that they need one and it was found."""
        if (now.kind, now.answers) != (before.kind, before.answers) and now.out == self._suggested:
            self.is_looking = True
        found = exporting.suggest(now) if self.is_looking else None
        if found is None:
            return now
        self._suggested, self.is_looking = found, False
        return now.changed(out=found)

    def draw(self, choices: ExportChoices, ui: UiState) -> ExportChoices:
        """Draw the field; returns the choices with the typed or chosen one."""
        label("Written to", imgui.get_style().window_padding.x)
        choices = self._take_native(choices, ui)
        imgui.set_next_item_width(-48 if self._has_native else -1)
        has_changed, out = imgui.input_text("##out", choices.out)
        ui.mark("export.out")
        if has_changed:
            self.is_looking = False
            choices = choices.changed(out=out)
        if self._has_native:
            imgui.same_line()
            if imgui.button(f"{Icon.FOLDER}##choose", ImVec2(-1, 0)) and self._native is None:
                folder, _, _ = choices.out.rpartition("/")
                self._native = native.select_folder("Folder to export into", folder)
            ui.mark("export.choose")
            imgui.set_item_tooltip("Choose a folder")
        return choices

    def _take_native(self, choices: ExportChoices, ui: UiState) -> ExportChoices:
        """The answer of the desktop's dialog: a folder, in which the name stays."""
        if self._native is None:
            return choices
        if not self._native.ready(0):
            ui.redraw_within(REFRESH_S)
            return choices
        folder, self._native = self._native.result(), None
        if not folder:
            return choices
        name = choices.out.replace("\\", "/").rpartition("/")[2]
        self._suggested, self.is_looking = f"{folder.rstrip('/')}/{name}", False
        return choices.changed(out=self._suggested)


def draw_plan(plan: ExportPlan | None, ui: UiState) -> None:
    """The planned export, or its fault. plan: None while it is being made."""
    if plan is None:
        text_wrapped_dim("Estimating the size ...")
        return
    for problem in plan.problems:
        imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
        imgui.same_line()
        text_wrapped(problem)
        ui.mark("export.problem")
    if not plan.problems:
        free = "" if plan.free_bytes is None else f"; {bytes_text(plan.free_bytes)} free"
        text_wrapped(f"{files_text(plan.n_files, plan.n_bytes).replace(', ', ', about ', 1)}{free}")
        ui.mark("export.plan")
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_DIM))
    for line in plan.lines:
        text_wrapped(line)
    imgui.pop_style_color()


def label(text: str, indent: float = 0.0) -> None:
    """Words in front of an answer, which begins where all answers do."""
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(LABEL_WIDTH + indent)
