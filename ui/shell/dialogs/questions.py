"""Questions of the session as dialogs: train a finished clip again, start over, which project of a capture to open.

A dialog is up as long as the session has the question. Enter says yes, Escape no.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.project.recents import RecentProject
from app.psnr_words import psnr_words
from app.session.captures.capture_commands import CorrectCapture
from app.session.clips.clip_questions import ClipQuestion
from app.session.commands import CloseQuestion, Command
from app.session.files.file_commands import CancelSaveAs
from app.session.files.file_questions import RecoveryQuestion, RelocationQuestion, SaveAsQuestion, SavingQuestion
from app.session.projects.project_commands import LeaveTraining, OpenCapture, OpenProject
from app.session.questions import (
    CorrectionQuestion,
    LeaveQuestion,
    ProjectQuestion,
    Question,
    RetrainQuestion,
    SettingsQuestion,
    StartOverQuestion,
)
from app.session.session_view import SessionView
from app.session.training.train_commands import TrainClip
from engine.text import duration_text
from ui.panels.pieces.widgets import elided, primary_button, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.shell.dialogs.clip_questions import clip_question_title, draw_clip_question
from ui.shell.dialogs.start_over_dialog import StartOverDialog
from ui.shell.dialogs.train_settings import SettingsDialog
from ui.shell.files.recovery_dialog import RecoveryDialog
from ui.shell.files.relocation_dialog import draw_relocation
from ui.shell.files.save_as_dialog import SaveAsDialog, draw_saving
from ui.style import theme
from ui.style.ago import ago_text
from ui.style.numbers import format_count
from ui.style.theme import Icon

WIDTH = 560.0
BUTTON = ImVec2(170, 34)
ROW_HEIGHT = 44.0
MAX_LISTED = 12
MAX_ROWS = 6
"""Of the list of projects; it scrolls."""


class QuestionDialogs:
    """Owns which row is chosen; the question itself is the session's."""

    def __init__(self) -> None:
        self._asked: Question | None = None
        self._chosen = 0
        self._settings, self._starting_over = SettingsDialog(), StartOverDialog()
        self._recovery, self._saving = RecoveryDialog(), SaveAsDialog()

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Draw the dialog of the session's question, if there is one."""
        question = session.question
        is_new, self._asked = question is not self._asked, question
        if question is None:
            return
        title = _title(question)
        if is_new:
            self._chosen = 0
            self._recovery.reset()
            if isinstance(question, SaveAsQuestion):
                self._saving.reset(question)
            imgui.open_popup(title)
        viewport = imgui.get_main_viewport()
        imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(min(WIDTH, viewport.work_size.x - 40), 0))
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize
        flags |= imgui.WindowFlags_.no_nav_inputs  # Enter, Escape and the arrows belong to the dialog
        is_open, is_kept = imgui.begin_popup_modal(title, True, flags)
        if not is_open:
            imgui.open_popup(title)  # a panel that came to the front has closed it; nobody has answered
            ui.redraw_within(0.0)
            return
        imgui.push_text_wrap_pos(0.0)
        # the key that led to the question is still pressed in its first frame, and is not an answer to it
        is_agreed = not is_new and imgui.is_key_pressed(imgui.Key.enter, False)
        if isinstance(question, RetrainQuestion):
            answer = _draw_retrain(question, ui, is_agreed)
        elif isinstance(question, SettingsQuestion):
            answer = self._draw_settings(question, ui, is_agreed)
        elif isinstance(question, CorrectionQuestion):
            answer = _draw_correction(question, ui, is_agreed)
        elif isinstance(question, RecoveryQuestion):
            answer = self._recovery.draw(question, ui, is_agreed)
        elif isinstance(question, RelocationQuestion):
            answer = draw_relocation(question, ui, is_agreed)
        elif isinstance(question, SaveAsQuestion):
            answer = self._saving.draw(question, ui, is_agreed)
        elif isinstance(question, SavingQuestion):
            answer = draw_saving(question, session.jobs, ui)
        elif isinstance(question, LeaveQuestion):
            answer = _draw_leaving(question, ui, is_agreed)
        elif isinstance(question, StartOverQuestion):
            answer = self._starting_over.draw(question, ui, is_agreed)
        elif isinstance(question, ClipQuestion):
            answer = draw_clip_question(question, ui, is_agreed)
        else:
            answer = self._draw_projects(question, ui, is_agreed)
        imgui.pop_text_wrap_pos()
        if answer is None and (not is_kept or (not is_new and imgui.is_key_pressed(imgui.Key.escape, False))):
            answer = _closing(question)
        if answer is not None:
            imgui.close_current_popup()
        imgui.end_popup()
        if answer is not None:
            dispatch(answer)

    def leave(self, session: SessionView, dispatch: Dispatch) -> None:
        """Answer as Escape does, for a question that cannot be drawn: it would be asked for ever."""
        if session.question is not None:
            dispatch(_closing(session.question))

    def _draw_settings(self, question: SettingsQuestion, ui: UiState, is_agreed: bool) -> Command | None:
        self._settings.draw(question, ui)
        if question.retrain is not None:
            _draw_what_it_means(question.retrain, ui)
        is_typing = imgui.get_io().want_text_input  # Enter ends what is typed, and does not answer yet
        if _button_row(ui, "Train" if question.retrain is None else "Train again") or (is_agreed and not is_typing):
            return self._settings.answer(question)
        return CloseQuestion() if _cancelled(ui) else None

    def _draw_projects(self, question: ProjectQuestion, ui: UiState, is_agreed: bool) -> Command | None:
        n_projects = len(question.choices)
        them = "a project. Open it, or make a new one?" if n_projects == 1 else f"{n_projects} projects. Which one?"
        imgui.text_wrapped(f"This capture has {them}")
        text_wrapped_dim(question.capture)
        imgui.spacing()
        n_rows = n_projects + (not question.how.is_read_only)
        self._chosen += imgui.is_key_pressed(imgui.Key.down_arrow) - imgui.is_key_pressed(imgui.Key.up_arrow)
        self._chosen %= n_rows
        answer: Command | None = None
        new = OpenCapture(
            Path(question.capture), is_new_project=True, follow_links=question.follow_links, is_asking=True
        )
        height = min(n_rows, MAX_ROWS) * (ROW_HEIGHT + 2 * imgui.get_style().item_spacing.y)
        if imgui.begin_child("projects", ImVec2(0, height)):
            width = imgui.get_content_region_avail().x
            for index, choice in enumerate(question.choices):
                words = project_words(choice, datetime.now(UTC), is_open=choice.folder == question.opened)
                if self._draw_row(index, f"{Icon.FOLDER}  {choice.name}", words, choice.project, width):
                    answer = OpenProject(Path(choice.project), question.how)
                ui.mark(f"question.choice{index}")
            if n_rows > n_projects:
                if self._draw_row(n_projects, f"{Icon.ADD}  New project", "", "The others stay as they are", width):
                    answer = new
                ui.mark("question.new")
        imgui.end_child()
        imgui.spacing()
        if _button_row(ui, "Open" if self._chosen < n_projects else "New project") or is_agreed:
            chosen = self._chosen
            answer = new if chosen == n_projects else OpenProject(Path(question.choices[chosen].project), question.how)
        return answer or (CloseQuestion() if _cancelled(ui) else None)

    def _draw_row(self, index: int, title: str, right: str, path: str, width: float) -> bool:
        """Name and state in one line, the path below. True when it is chosen by a double click."""
        start = imgui.get_cursor_pos()
        flags = imgui.SelectableFlags_.allow_double_click | imgui.SelectableFlags_.no_auto_close_popups
        is_clicked = imgui.selectable(f"##row{index}", index == self._chosen, flags, ImVec2(width, ROW_HEIGHT))[0]
        end = imgui.get_cursor_pos()
        if is_clicked:
            self._chosen = index
        is_taken = is_clicked and imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
        right_x = start.x + width - imgui.calc_text_size(right).x - 10
        imgui.set_cursor_pos(ImVec2(start.x + 10, start.y + 3))
        imgui.text(elided(title, right_x - start.x - 20))
        imgui.set_cursor_pos(ImVec2(right_x, start.y + 3))
        imgui.text_disabled(right)
        imgui.set_cursor_pos(ImVec2(start.x + 10, start.y + 23))
        imgui.text_disabled(elided(path, width - 20))
        imgui.set_cursor_pos(end)
        imgui.dummy(ImVec2(0, 0))
        return is_taken


def _closing(question: Question) -> Command:
    """The command for Escape and the cross of a dialog."""
    return CancelSaveAs() if isinstance(question, SavingQuestion) else CloseQuestion()


def _title(question: Question) -> str:
    if isinstance(question, ClipQuestion):
        return clip_question_title(question)
    if isinstance(question, SettingsQuestion):
        return f"Train clip {question.clip_index} with other settings###question"
    if isinstance(question, RetrainQuestion):
        return f"Train clip {question.clip_index} again?###question"
    if isinstance(question, CorrectionQuestion):
        return "Correct the capture?###question"
    if isinstance(question, RecoveryQuestion):
        return "The project is damaged###question"
    if isinstance(question, RelocationQuestion):
        return "Where is the capture?###question"
    if isinstance(question, SaveAsQuestion):
        return "Save the project as###question"
    if isinstance(question, SavingQuestion):
        return "Saving the project###question"
    if isinstance(question, LeaveQuestion):
        return "Stop the training?###question"
    if isinstance(question, StartOverQuestion):
        return "Start over with other settings###question"
    return "Open a project###question"


def _draw_correction(question: CorrectionQuestion, ui: UiState, is_agreed: bool) -> Command | None:
    for text in correction_texts(question):
        imgui.text_wrapped(text)
        imgui.spacing()
    if _button_row(ui, "Write and open") or is_agreed:
        return CorrectCapture(question.corrections, question.words, is_confirmed=True)
    return CloseQuestion() if _cancelled(ui) else None


def _draw_leaving(question: LeaveQuestion, ui: UiState, is_agreed: bool) -> Command | None:
    for text in leaving_texts(question):
        imgui.text_wrapped(text)
        imgui.spacing()
    if _button_row(ui, "Stop and open") or is_agreed:
        return LeaveTraining()
    return CloseQuestion() if _cancelled(ui) else None


def _draw_retrain(question: RetrainQuestion, ui: UiState, is_agreed: bool) -> Command | None:
    _draw_what_it_means(question, ui)
    if _button_row(ui, "Train again") or is_agreed:
        return TrainClip(question.clip_index, is_confirmed=True, settings=question.settings)
    return CloseQuestion() if _cancelled(ui) else None


def _draw_what_it_means(question: RetrainQuestion, ui: UiState) -> None:
    for text in retrain_texts(question):
        imgui.text_wrapped(text)
        imgui.spacing()
    if question.outdated:
        imgui.text_colored(theme.ORANGE, Icon.WARNING)
        imgui.same_line()
        imgui.text_wrapped(outdated_text(question))
        ui.mark("question.outdated")
        imgui.spacing()


def _button_row(ui: UiState, yes: str) -> bool:
    imgui.separator()
    imgui.spacing()
    imgui.set_cursor_pos_x(imgui.get_window_width() - 2 * BUTTON.x - 20)
    is_clicked = primary_button(yes, BUTTON, ui)
    ui.mark("question.yes")
    imgui.same_line()
    return is_clicked


def _cancelled(ui: UiState) -> bool:
    is_clicked = imgui.button("Cancel", BUTTON)
    ui.mark("question.no")
    return is_clicked


# ---- words -----------------------------------------------------------------------------------------------------


def project_words(project: RecentProject, now: datetime, *, is_open: bool) -> str:
    """Words of a project's row in the list: preset, how far it is trained, when it was open."""
    preset = f"preset {project.preset}" if project.preset else ""
    when = "open now" if is_open else ago_text(project.opened, now)
    return ", ".join(filter(None, (preset, project.trained_text, when)))


def leaving_texts(question: LeaveQuestion) -> list[str]:
    """Text of the dialog before a training is stopped by opening another project."""
    step = ""
    if question.step:
        step = f", step {format_count(question.step)} of {format_count(question.n_steps)}"
    waiting = ""
    if question.n_waiting:
        waiting = " 1 clip that waits" if question.n_waiting == 1 else f" {question.n_waiting} clips that wait"
        waiting += " will have to be queued again."
    n = question.n_beside
    others = f" {n} other {'clip trains' if n == 1 else 'clips train'}, too." if n else ""
    it = "all of them; their" if others else "it; its"
    return [
        f"Clip {question.clip_index} is being trained{step}.{others} Opening {question.name} stops {it} progress is "
        f"kept.{waiting}"
    ]


def correction_texts(question: CorrectionQuestion) -> list[str]:
    """Text of the dialog before a capture is corrected, paragraph by paragraph."""
    kept = " with its progress" if question.has_progress else ""
    return [
        f"{question.words}: this is written to capture.json in {question.capture}. No other file of the capture "
        "changes; delete or edit that file to revert.",
        f"The open project no longer matches the corrected capture. It stays in {question.project}{kept}. The "
        "corrected capture is opened as a new project.",
    ]


def retrain_texts(question: RetrainQuestion) -> list[str]:
    """Text of the dialog about the clip itself, paragraph by paragraph."""
    clip = f"Clip {question.clip_index}"
    if question.is_damaged:
        texts = [
            f"{clip} was finished, but cannot be read. {question.reason}",
            'Training it again moves the damaged file to the project\'s folder "damaged".',
        ]
    else:
        psnr = question.held_out_psnr
        figure = "" if psnr is None else f" ({psnr_words(psnr, is_whole=question.held_out_whole)})"
        texts = [
            f"{clip} is finished{figure}. It stays in use until the new training finishes, and is then kept as an "
            "earlier version."
        ]
    if question.resume_step is not None:
        texts.append(f"Training resumes at step {format_count(question.resume_step)}, where it was stopped.")
    if question.seconds is not None:
        basis = "the average clip of this project" if question.is_average else "its last training"
        texts.append(f"This takes about {duration_text(question.seconds)}, judging by {basis}.")
    return texts


def outdated_text(question: RetrainQuestion) -> str:
    """Text of the dialog about the clips that depend on it."""
    n = len(question.outdated)
    listed = ", ".join(str(index) for index in question.outdated[:MAX_LISTED])
    more = f" and {n - MAX_LISTED} more" if n > MAX_LISTED else ""
    cost = ""
    if question.outdated_seconds is not None:
        cost = f", about {duration_text(question.outdated_seconds)}"
    if n == 1:
        return f"Clip {listed} was trained on it. It will be out of date and has to be retrained{cost}."
    every = f"{n} clips were trained on it: {listed}{more}."
    return f"{every} They will be out of date and have to be retrained{cost}."
