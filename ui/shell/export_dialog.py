"""The dialog that asks what is exported, of which frames and where, and says beforehand what will be written.

Enter exports where nothing is wrong, Escape closes. What is asked comes from a table: app.export.forms.
"""

from __future__ import annotations

from typing import Any, Protocol

from imgui_bundle import ImVec2, ImVec4, imgui
from imgui_bundle import portable_file_dialogs as native

from app.export.export_choices import FRAMES_CHOICES, ExportChoices, ExportContext, FramesChoice
from app.export.export_jobs import KINDS
from app.export.export_plan import ExportPlan
from app.export.forms.form import Option
from app.export.forms.table import FORMS
from app.session.commands import CloseQuestion, Command, StartExport
from engine.text import one_line
from ui.panels.exports import ExportingFacts, bytes_text, files_text
from ui.panels.state import EXPORTS, Dispatch, UiState
from ui.panels.widgets import elided, primary_button, segment, text_wrapped, text_wrapped_dim
from ui.shell.dialogs import has_native_dialog
from ui.shell.modal import Modal
from ui.style import theme
from ui.style.theme import Icon

TITLE = "Export###export"
SIZE = (900.0, 700.0)
BUTTON = ImVec2(170, 34)
LABEL_WIDTH = 130.0
BOX_WIDTH = 320.0
PLAN_HEIGHT = 112.0
PLACE_HEIGHT = 66.0
FRAMES_WIDTH = 300.0
MAX_RADIOS = 6
"""More answers than this go into a box."""
REFRESH_S = 0.1


class ExportingNeeds(ExportingFacts, Protocol):
    """What the dialog reads of Exporting."""

    @property
    def page(self) -> ExportPageFacts | None: ...

    def plan(self, choices: ExportChoices) -> ExportPlan | None: ...

    def suggest(self, context: ExportContext, choices: ExportChoices) -> str: ...


class ExportPageFacts(Protocol):
    """See app.session.exporting.ExportPage."""

    @property
    def context(self) -> ExportContext: ...

    @property
    def choices(self) -> ExportChoices: ...


class HasExporting(Protocol):
    """A session with one."""

    @property
    def exporting(self) -> ExportingNeeds: ...


class ExportDialog:
    """Owns what was chosen so far."""

    def __init__(self) -> None:
        self._modal = Modal()
        self._page: ExportPageFacts | None = None
        self._choices = ExportChoices()
        self._suggested = ""
        self._native: Any = None
        self._has_native = False
        self._is_box_open = False

    def draw(self, session: HasExporting, dispatch: Dispatch, ui: UiState) -> None:
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
            self._page, self._choices, self._suggested = page, page.choices, page.choices.out
            self._has_native = has_native_dialog()
        has_keys, self._is_box_open = not self._is_box_open, False  # an open box of answers takes Enter and Escape
        is_agreed, is_left = keys.is_agreed and has_keys, keys.is_left and has_keys
        before = self._choices
        height = -(BUTTON.y + PLAN_HEIGHT + PLACE_HEIGHT)
        if imgui.begin_child("choices", ImVec2(0, height), imgui.ChildFlags_.nav_flattened):
            self._draw_choices(page.context, ui)
        imgui.end_child()
        if is_agreed:  # Enter also presses what the arrow keys are on
            self._choices = before
        self._suggest_anew(exporting, page.context, before)
        imgui.separator()
        self._draw_place(ui)
        plan = exporting.plan(self._choices)
        if plan is None:
            ui.redraw_within(REFRESH_S)
        if imgui.begin_child("plan", ImVec2(0, PLAN_HEIGHT), imgui.ChildFlags_.nav_flattened):
            _draw_plan(plan, ui)
        imgui.end_child()
        imgui.separator()
        answer = self._draw_buttons(plan, ui, is_agreed=is_agreed)
        if answer is None and (is_left or keys.is_closed):
            answer = CloseQuestion()
        if answer is not None:
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            if isinstance(answer, StartExport):
                ui.wanted_panel = EXPORTS
            dispatch(answer)

    def _suggest_anew(self, exporting: ExportingNeeds, context: ExportContext, before: ExportChoices) -> None:
        """Another kind or format gets another name, unless the user has typed one."""
        now = self._choices
        has_changed = (now.kind, now.answers) != (before.kind, before.answers)
        if has_changed and now.out == self._suggested:
            self._suggested = exporting.suggest(context, now)
            self._choices = now.changed(out=self._suggested)

    # ---- what is asked

    def _draw_choices(self, context: ExportContext, ui: UiState) -> None:
        choices = self._choices
        _label("What")
        for place, kind in enumerate(FORMS):
            if place:
                imgui.same_line(0, 6)
            imgui.push_id(kind)
            if segment(KINDS[kind].title, choices.kind == kind):
                self._choices = choices = choices.changed(kind=kind)
            imgui.pop_id()
            ui.mark(f"export.kind.{kind}")
        form = FORMS[choices.kind]
        _label("")
        text_wrapped_dim(form.about)
        imgui.spacing()
        for option in form.options(context, choices):
            self._draw_option(option, ui)
        if form.has_frames:
            imgui.spacing()
            self._draw_frames(context, ui)

    def _draw_option(self, option: Option, ui: UiState) -> None:
        chosen = option.chosen(self._choices)
        _label(option.label)
        imgui.push_id(option.name)
        if len(option.values) > MAX_RADIOS:
            if _begin_box(one_line(dict(option.values)[chosen])):
                self._is_box_open = True
                for place, (value, words) in enumerate(option.values):
                    imgui.push_id(place)
                    is_clicked = imgui.selectable("##answer", value == chosen)[0]
                    imgui.pop_id()
                    ui.mark(f"export.{option.name}.{value}")
                    imgui.same_line(0, 4)
                    imgui.text(one_line(words))  # as it is, whatever signs are in a name
                    if is_clicked:
                        chosen = value
                imgui.end_combo()
            ui.mark(f"export.{option.name}")
        else:
            for place, (value, words) in enumerate(option.values):
                if place:
                    _same_line_if_fits(words)
                imgui.push_id(place)
                if imgui.radio_button(f"{words}##answer", value == chosen):
                    chosen = value
                imgui.pop_id()
                ui.mark(f"export.{option.name}.{value}")
                if value in option.tips:
                    imgui.set_item_tooltip(option.tips[value])
        imgui.pop_id()
        if chosen != option.chosen(self._choices):
            self._choices = self._choices.with_answer(option.name, chosen)

    def _draw_frames(self, context: ExportContext, ui: UiState) -> None:
        words: dict[FramesChoice, str] = {
            "all": "All that are trained",
            "range": "From in to out",
            "clip": "This clip",
            "frame": "This frame",
        }
        for place, choice in enumerate(FRAMES_CHOICES):
            if place % 2:
                imgui.same_line(LABEL_WIDTH + FRAMES_WIDTH)
            else:
                _label("Frames" if place == 0 else "")
            if imgui.radio_button(f"{words[choice]}##frames", self._choices.frames == choice):
                self._choices = self._choices.changed(frames=choice)
            ui.mark(f"export.frames.{choice}")
            imgui.same_line()
            imgui.text_disabled(_frames_text(context.frames(choice, 1)))
        if not FORMS[self._choices.kind].has_step:
            return
        _label("")
        imgui.begin_disabled(self._choices.frames == "frame")
        imgui.text("One of every")
        imgui.same_line()
        imgui.set_next_item_width(110)
        has_changed, step = imgui.input_int("frames##step", self._choices.step)
        ui.mark("export.step")
        imgui.end_disabled()
        if has_changed:
            self._choices = self._choices.changed(step=min(max(step, 1), 100_000))

    def _draw_place(self, ui: UiState) -> None:
        _label("Written to", imgui.get_style().window_padding.x)
        self._take_native(ui)
        imgui.set_next_item_width(-48 if self._has_native else -1)
        has_changed, out = imgui.input_text("##out", self._choices.out)
        ui.mark("export.out")
        if has_changed:
            self._choices = self._choices.changed(out=out)
        if self._has_native:
            imgui.same_line()
            if imgui.button(f"{Icon.FOLDER}##choose", ImVec2(-1, 0)) and self._native is None:
                folder, _, _ = self._choices.out.rpartition("/")
                self._native = native.select_folder("Folder to export into", folder)
            ui.mark("export.choose")
            imgui.set_item_tooltip("Choose a folder")

    def _take_native(self, ui: UiState) -> None:
        """The answer of the desktop's dialog: a folder, in which the name stays."""
        if self._native is None:
            return
        if not self._native.ready(0):
            ui.redraw_within(REFRESH_S)
            return
        folder, self._native = self._native.result(), None
        if folder:
            name = self._choices.out.replace("\\", "/").rpartition("/")[2]
            self._suggested = f"{folder.rstrip('/')}/{name}"
            self._choices = self._choices.changed(out=self._suggested)

    def _draw_buttons(self, plan: ExportPlan | None, ui: UiState, *, is_agreed: bool) -> Command | None:
        imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 22)
        is_cancelled = imgui.button("Cancel", BUTTON)
        ui.mark("export.cancel")
        imgui.same_line()
        is_possible = plan is not None and not plan.problems
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


def _draw_plan(plan: ExportPlan | None, ui: UiState) -> None:
    if plan is None:
        text_wrapped_dim("Looking at what would be written ...")
        return
    for problem in plan.problems:
        imgui.text_colored(ImVec4(*theme.ORANGE), Icon.WARNING)
        imgui.same_line()
        text_wrapped(problem)
        ui.mark("export.problem")
    if not plan.problems:
        free = "" if plan.free_bytes is None else f"; {bytes_text(plan.free_bytes)} are free"
        text_wrapped(f"{files_text(plan.n_files, plan.n_bytes).replace(', ', ', about ', 1)}{free}")
        ui.mark("export.plan")
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.TEXT_DIM))
    for line in plan.lines:
        text_wrapped(line)
    imgui.pop_style_color()


def _frames_text(frames: range) -> str:
    if not frames:
        return "none"
    return f"{frames[0]}" if len(frames) == 1 else f"{frames[0]} to {frames[-1]}"


def _same_line_if_fits(words: str) -> None:
    """Beside the answer before, or below it where there is no room."""
    width = imgui.calc_text_size(words).x + imgui.get_frame_height() + 12
    end = imgui.get_item_rect_max().x + imgui.get_style().item_spacing.x + width
    if end < imgui.get_window_pos().x + imgui.get_window_width():
        imgui.same_line()
    else:
        imgui.set_cursor_pos_x(LABEL_WIDTH)


def _label(text: str, indent: float = 0.0) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(LABEL_WIDTH + indent)
