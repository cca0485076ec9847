"""The dialog for a folder that is opened and has no project yet: what it is and what is asked, or why it does not open.

Enter opens, Escape cancels; Tab and arrow keys move, Space switches.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from app.playback.modes.arrays import Picture
from app.project.opening.capture_report import CaptureReport, RefusedFolder
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture
from app.session.questions import OpeningPage
from app.session.session_view import OpeningView, SessionView
from engine.doctor.finding import Finding
from engine.text import one_line
from ui.gl import ImageTexture
from ui.panels.doctor.words import SEVERITY_ICONS, severity_color
from ui.panels.pieces.widgets import (
    elided,
    elided_path,
    pop_bold,
    primary_button,
    push_bold,
    text_wrapped,
    text_wrapped_dim,
)
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.welcome.thumbnails import crop_to
from ui.shell.dialogs.modal import Modal
from ui.shell.dialogs.opening.opening_answers_form import AnswersForm
from ui.shell.dialogs.opening.refused_folder import draw_refused
from ui.style import theme
from ui.style.theme import Icon

OPEN, REFUSED = "Open a capture###opening", "This folder cannot be opened###refused"
SIZE = (1080.0, 690.0)
REFUSED_SIZE = (700.0, 420.0)
FORM_WIDTH = 410.0
BUTTON = ImVec2(150, 34)
LEAST_PICTURE_WIDTH, PICTURE_SHAPE = 120.0, 0.62
"""Of the small pictures: units, and height by width."""
WORD_WIDTH = 92.0
INDENT = 23.0
"""Of the parts that belong to words after a sign."""
MORE = 'Once it is open, "Examine the capture" checks the pictures, too.'


class OpeningDialog:
    """Owns the answers so far, and textures of small pictures. GL thread only.

    Args:
        make_texture: Makes an empty texture.
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._make_texture = make_texture
        self._textures: dict[int, ImageTexture] = {}
        self._shown: OpeningPage | RefusedFolder | None = None
        self._form = AnswersForm()
        self._modal = Modal()

    def release(self) -> None:
        """Free the pictures."""
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Draw the dialog, if there is a question or a message."""
        opening = session.opening
        shown = opening.page or opening.refused
        is_new = shown is not self._shown
        if is_new:
            self.release()
        self._shown = shown
        is_page = isinstance(shown, OpeningPage)
        keys = self._modal.begin(shown, OPEN if is_page else REFUSED, SIZE if is_page else REFUSED_SIZE)
        if keys is None or shown is None:
            return
        if not keys.is_up:
            dispatch(CloseQuestion())
            return
        if isinstance(shown, OpeningPage):
            answer = self._draw_page(shown, opening, ui, is_agreed=keys.is_agreed)
        else:
            answer = draw_refused(shown, ui, is_agreed=keys.is_agreed)
        if answer is None and (keys.is_left or keys.is_closed):
            answer = CloseQuestion()
        if answer is not None:
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            dispatch(answer)

    def _draw_page(
        self, page: OpeningPage, opening: OpeningView, ui: UiState, *, is_agreed: bool
    ) -> OpenCapture | CloseQuestion | None:
        self._form.begin(page)
        height = -(BUTTON.y + 18)
        flags = imgui.ChildFlags_.nav_flattened
        if imgui.begin_child("report", ImVec2(-FORM_WIDTH - 14, height), flags):
            self._draw_report(page.report, page.folder, opening, ui)
        imgui.end_child()
        imgui.same_line(0, 14)
        if imgui.begin_child("form", ImVec2(0, height), flags):
            self._form.draw(opening, ui, is_fixed=is_agreed)
        imgui.end_child()
        imgui.separator()
        answers = self._form.answers
        is_possible = not opening.problem(answers)
        is_copied = imgui.button(f"{Icon.COPY}  Copy the report", ImVec2(0, BUTTON.y))
        ui.mark("opening.copy")
        if is_copied and not is_agreed:
            imgui.set_clipboard_text(page.report.text)
        imgui.same_line(imgui.get_window_width() - 2 * BUTTON.x - 22)
        if imgui.button("Cancel", BUTTON):
            return CloseQuestion()
        ui.mark("opening.cancel")
        imgui.same_line()
        imgui.begin_disabled(not is_possible)
        is_clicked = primary_button("Open", BUTTON, ui)
        ui.mark("opening.accept")
        imgui.set_item_default_focus()
        imgui.end_disabled()
        if is_possible and (is_clicked or is_agreed):
            return OpenCapture(
                page.report.path,
                is_new_project=page.is_new_project,
                follow_links=page.follow_links,
                answers=answers,
            )
        return None

    def _draw_report(self, report: CaptureReport, folder: Path, opening: OpeningView, ui: UiState) -> None:
        width = imgui.get_content_region_avail().x
        push_bold(ui, ui.fonts.body_size + 2)
        imgui.text(elided(report.path.name or str(report.path), width))
        pop_bold(ui)
        imgui.text_disabled(elided_path(str(report.path), width))
        imgui.spacing()
        for name, words in report.rows:
            imgui.text_disabled(name)
            imgui.same_line(WORD_WIDTH)
            text_wrapped(words)
        for sentence in report.warnings:
            imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
            imgui.same_line()
            text_wrapped(sentence)
        imgui.text_disabled("Project")
        imgui.same_line(WORD_WIDTH)
        imgui.text(elided_path(one_line(str(folder)), width - WORD_WIDTH))
        ui.mark("opening.folder")
        imgui.set_item_tooltip(f"{one_line(str(folder))}\nWhere projects go is set in the preferences.")
        _draw_findings(opening.findings, ui)
        imgui.spacing()
        self._draw_pictures(report, opening.pictures, ui)

    def _draw_pictures(self, report: CaptureReport, pictures: Mapping[int, Picture], ui: UiState) -> None:
        """The first picture of each camera, side by side."""
        spacing = 8.0
        room = imgui.get_content_region_avail().x - 4
        n_columns = max(int((room + spacing) / (LEAST_PICTURE_WIDTH + spacing)), 1)
        width = (room - (n_columns - 1) * spacing) / n_columns
        height = width * PICTURE_SHAPE
        draw, start = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos()
        answers = self._form.answers
        line = imgui.get_text_line_height() + 4
        for row, camera in enumerate(report.cameras):
            x = start.x + (row % n_columns) * (width + spacing)
            y = start.y + (row // n_columns) * (height + line + spacing)
            box = Rect(x, y, x + width, y + height)
            texture = self._texture(row, pictures)
            if texture is None:
                draw.add_rect_filled(box.low, box.high, theme.u32(theme.BACKDROP), 3)
                draw.add_text(ImVec2(box.center[0] - 9, box.center[1] - 8), theme.u32(theme.OUTLINE), Icon.CAMERA)
            else:
                low, high = crop_to(texture.size[0] / max(texture.size[1], 1), box.width / box.height)
                white = theme.u32(theme.rgb(255, 255, 255))
                draw.add_image_rounded(imgui.ImTextureRef(texture.texture.glo), box.low, box.high, low, high, white, 3)
            is_out = camera.name in answers.holdout
            if is_out:
                draw.add_rect(box.low, box.high, theme.u32(theme.HELD_OUT), 3.0, 2.0)
            color = theme.u32(theme.HELD_OUT if is_out else theme.TEXT_DIM)
            words = f"{camera.name}, held out" if is_out else camera.name
            draw.add_text(ImVec2(x, box.y1 + 2), color, elided(words, width))
        n_rows = -(-len(report.cameras) // n_columns)
        imgui.dummy(ImVec2(1, n_rows * (height + line + spacing)))
        if len(self._textures) < len(report.cameras):
            ui.redraw_within(0.2)

    def _texture(self, row: int, pictures: Mapping[int, Picture]) -> ImageTexture | None:
        if row not in self._textures and row in pictures:
            texture = self._make_texture()
            texture.set(pictures[row].image)
            self._textures[row] = texture
        return self._textures.get(row)


def _draw_findings(findings: Sequence[Finding] | None, ui: UiState) -> None:
    """Problems found in the numbers, with advice; nothing before they are known."""
    if findings is None:
        return
    for index, finding in enumerate(findings):
        imgui.text_colored(ImVec4(*severity_color(finding.severity)), SEVERITY_ICONS[finding.severity])
        imgui.same_line()
        text_wrapped(finding.text)
        ui.mark(f"opening.finding{index}")
        imgui.indent(INDENT)
        text_wrapped_dim(finding.advice)
        imgui.unindent(INDENT)
    text_wrapped_dim(MORE if findings else f"No problems found so far. {MORE}")
