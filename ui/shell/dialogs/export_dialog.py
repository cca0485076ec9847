"""The dialog that asks what is exported, of which frames and where, and says beforehand what will be written.

Enter exports where nothing is wrong, Escape closes. The questions follow from the jobs: app.export.jobs.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.export.export_choices import FRAMES_CHOICES, ExportChoices, ExportContext, FramesChoice
from app.export.export_plan import ExportPlan
from app.export.jobs.answers import Answers
from app.export.jobs.question import Question
from app.export.jobs.table import KINDS
from app.export.picked_frames import PickedFrames
from app.session.commands import CloseQuestion, Command
from app.session.export_commands import StartExport
from app.session.exporting import ExportPage
from app.session.session_view import SessionView
from engine.text import one_line
from ui.panels.pieces.copying import COMMAND, draw_copy_entries
from ui.panels.pieces.widgets import elided, primary_button, segment, text_wrapped_dim
from ui.panels.state import EXPORTS, Dispatch, UiState
from ui.shell.dialogs.export_place import LABEL_WIDTH, REFRESH_S, ExportPlace, draw_plan, label
from ui.shell.dialogs.modal import Modal
from ui.style import theme
from ui.style.theme import Icon

TITLE = "Export###export"
SIZE = (900.0, 740.0)
BUTTON = ImVec2(170, 34)
BOX_WIDTH = 320.0
PLAN_HEIGHT = 112.0
PLACE_HEIGHT = 66.0
FRAMES_WIDTH = 300.0
MAX_RADIOS = 6
"""More answers than this go into a box, and names whatever their number."""


class ExportDialog:
    """Owns the choices so far."""

    def __init__(self) -> None:
        self._modal = Modal()
        self._page: ExportPage | None = None
        self._choices = ExportChoices()
        self._place = ExportPlace()
        self._is_box_open = False

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Draw the dialog while an export is asked for."""
        exporting = session.exporting
        page = exporting.page
        keys = self._modal.begin(page, TITLE, SIZE)
        if keys is None or page is None:
            return
        if not keys.is_up:
            dispatch(CloseQuestion())
            return
        if page is not self._page:
            self._page, self._choices = page, page.choices
            self._place.begin(page.choices)
        has_keys, self._is_box_open = not self._is_box_open, False  # an open box of answers takes Enter and Escape
        is_agreed, is_left = keys.is_agreed and has_keys, keys.is_left and has_keys
        before = self._choices
        height = -(BUTTON.y + PLAN_HEIGHT + PLACE_HEIGHT)
        if imgui.begin_child("choices", ImVec2(0, height), imgui.ChildFlags_.nav_flattened):
            self._draw_choices(page.context, ui)
        imgui.end_child()
        if is_agreed:  # Enter also presses what the arrow keys are on
            self._choices = before
        self._choices = self._place.suggested(exporting, before, self._choices)
        imgui.separator()
        self._choices = self._place.draw(self._choices, ui)
        plan = None if self._place.is_looking else exporting.plan(self._choices)
        if plan is None:
            ui.redraw_within(REFRESH_S)
        if imgui.begin_child("plan", ImVec2(0, PLAN_HEIGHT), imgui.ChildFlags_.nav_flattened):
            draw_plan(plan, ui)
        imgui.end_child()
        imgui.separator()
        answer = self._draw_buttons(session, page, plan, ui, is_agreed=is_agreed)
        if answer is None and (is_left or keys.is_closed):
            answer = CloseQuestion()
        if answer is not None:
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            if isinstance(answer, StartExport):
                ui.wanted_panel = EXPORTS
            dispatch(answer)

    # ---- what is asked

    def _draw_choices(self, context: ExportContext, ui: UiState) -> None:
        choices = self._choices
        label("What")
        for place, (kind, job) in enumerate(KINDS.items()):
            if place:
                imgui.same_line(0, 6)
            imgui.push_id(kind)
            if segment(job.title, choices.kind == kind):
                self._choices = choices = choices.changed(kind=kind)
            imgui.pop_id()
            ui.mark(f"export.kind.{kind}")
        answers = Answers(context, choices)
        label("")
        text_wrapped_dim(answers.job_type.about)
        imgui.spacing()
        for question in answers.questions:
            self._draw_question(question, ui)
        if answers.job_type.takes("frames"):
            imgui.spacing()
            self._draw_frames(context, ui)

    def _draw_question(self, question: Question, ui: UiState) -> None:
        chosen = question.chosen(self._choices)
        label(question.label)
        imgui.push_id(question.name)
        if not question.values:
            imgui.set_next_item_width(BOX_WIDTH)
            chosen = imgui.input_text_with_hint("##text", question.hint, chosen)[1]
            ui.mark(f"export.{question.name}")
        elif question.has_names or len(question.values) > MAX_RADIOS:  # a label would end at a "##" in a name
            if _begin_box(one_line(dict(question.values)[chosen])):
                self._is_box_open = True
                for place, (value, words) in enumerate(question.values):
                    imgui.push_id(place)
                    is_clicked = imgui.selectable("##answer", value == chosen)[0]
                    imgui.pop_id()
                    ui.mark(f"export.{question.name}.{value}")
                    imgui.same_line(0, 4)
                    imgui.text(one_line(words))  # as it is, whatever signs are in a name
                    if is_clicked:
                        chosen = value
                imgui.end_combo()
            ui.mark(f"export.{question.name}")
        else:
            for place, (value, words) in enumerate(question.values):
                if place:
                    _same_line_if_fits(words)
                imgui.push_id(place)
                if imgui.radio_button(f"{words}##answer", value == chosen):
                    chosen = value
                imgui.pop_id()
                ui.mark(f"export.{question.name}.{value}")
                if value in question.tips:
                    imgui.set_item_tooltip(question.tips[value])
        imgui.pop_id()
        if chosen != question.chosen(self._choices):
            self._choices = self._choices.with_answer(question.name, chosen)

    def _draw_frames(self, context: ExportContext, ui: UiState) -> None:
        words: dict[FramesChoice, str] = {
            "all": "All finished",
            "range": "From in to out",
            "clip": "This clip",
            "frame": "This frame",
        }
        for place, choice in enumerate(FRAMES_CHOICES):
            if place % 2:
                imgui.same_line(LABEL_WIDTH + FRAMES_WIDTH)
            else:
                label("Frames" if place == 0 else "")
            if imgui.radio_button(f"{words[choice]}##frames", self._choices.frames == choice):
                self._choices = self._choices.changed(frames=choice)
            ui.mark(f"export.frames.{choice}")
            imgui.same_line()
            imgui.text_disabled(_frames_text(context.frames(choice, 1)))
        if not KINDS[self._choices.kind].has_step:
            return
        label("")
        imgui.begin_disabled(self._choices.frames == "frame")
        imgui.text("One of every")
        imgui.same_line()
        imgui.set_next_item_width(110)
        has_changed, step = imgui.input_int("frames##step", self._choices.step)
        ui.mark("export.step")
        imgui.end_disabled()
        if has_changed:
            self._choices = self._choices.with_step(step)

    def _draw_buttons(
        self, session: SessionView, page: ExportPage, plan: ExportPlan | None, ui: UiState, *, is_agreed: bool
    ) -> Command | None:
        is_possible = plan is not None and not plan.problems
        imgui.begin_disabled(not is_possible)
        if imgui.button(f"{Icon.COPY}  {COMMAND}", BUTTON):
            imgui.open_popup("copy")
        ui.mark("export.copy")
        imgui.end_disabled()
        if imgui.begin_popup("copy"):
            self._is_box_open = True
            draw_copy_entries(ui, "export", lambda: session.command_texts.export(page.context, self._choices))
            imgui.end_popup()
        imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 22)
        is_cancelled = imgui.button("Cancel", BUTTON)
        ui.mark("export.cancel")
        imgui.same_line()
        imgui.begin_disabled(not is_possible)
        is_clicked = primary_button("Export", BUTTON, ui)
        ui.mark("export.start")
        imgui.set_item_default_focus()
        imgui.end_disabled()
        if is_cancelled:
            return CloseQuestion()
        return StartExport(self._choices) if is_possible and (is_clicked or is_agreed) else None


def _begin_box(words: str) -> bool:
    """A box of answers with any words in it; ImGui itself would leave out what follows "##"."""
    draw, corner, padding = imgui.get_window_draw_list(), imgui.get_cursor_screen_pos(), imgui.get_style().frame_padding
    imgui.set_next_item_width(BOX_WIDTH)
    is_open = imgui.begin_combo("##box", "")
    width = BOX_WIDTH - imgui.get_frame_height() - 2 * padding.x
    draw.add_text(ImVec2(corner.x + padding.x, corner.y + padding.y), theme.u32(theme.TEXT), elided(words, width))
    return is_open


def _frames_text(frames: PickedFrames) -> str:
    runs = frames.runs
    listed = ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:2] if run)
    return f"{listed} and more" if len(runs) > 2 else listed or "none"


def _same_line_if_fits(words: str) -> None:
    """Beside the answer before, or below it where there is no room."""
    width = imgui.calc_text_size(words).x + imgui.get_frame_height() + 12
    end = imgui.get_item_rect_max().x + imgui.get_style().item_spacing.x + width
    if end < imgui.get_window_pos().x + imgui.get_window_width():
        imgui.same_line()
    else:
        imgui.set_cursor_pos_x(LABEL_WIDTH)
