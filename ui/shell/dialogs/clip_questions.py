"""Questions about clips and their files, as the inside of a dialog: cutting them otherwise, making room, damage.

Each function draws the words and the buttons, and returns the command that is the answer, or None.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app.session.clips.clip_commands import ApplyDeletions, FreeSpace
from app.session.clips.clip_questions import ClipQuestion, CutQuestion, DamagedQuestion, DeletionsQuestion, RoomQuestion
from app.session.commands import CloseQuestion, Command
from app.session.training.train_commands import RestoreVersion, TrainClip
from engine.text import duration_text, size_text
from ui.panels.pieces.widgets import primary_button, text_wrapped
from ui.panels.state import UiState
from ui.style.theme import Icon

BUTTON_HEIGHT = 34.0


def clip_question_title(question: ClipQuestion) -> str:
    """The title bar."""
    match question:
        case CutQuestion(words=words):
            return f"{words}?###question"
        case RoomQuestion():
            return "Make room on the disk?###question"
        case DamagedQuestion(clip_index=clip_index):
            return f"Clip {clip_index} is damaged###question"
        case DeletionsQuestion():
            return "Apply deletions permanently?###question"


def draw_clip_question(question: ClipQuestion, ui: UiState, is_agreed: bool) -> Command | None:
    """Words and buttons. is_agreed: Enter was pressed."""
    for text in clip_question_texts(question):
        text_wrapped(text)
        imgui.spacing()
    match question:
        case CutQuestion():
            yes: Sequence[tuple[str, str, Command]] = (
                ("yes", question.words.partition(" ")[0], replace(question.command, is_confirmed=True)),
            )
        case RoomQuestion():
            words = f"Delete, and free {size_text(question.n_bytes / 1e6)}"
            yes = (("yes", words, FreeSpace(question.what, question.clip_index)),)
        case DamagedQuestion():
            again = ("again", "Train it again", TrainClip(question.clip_index, is_confirmed=True))
            back = () if question.version is None else (_bring_back(question.clip_index, question.version),)
            yes = (*back, again)
        case DeletionsQuestion():
            yes = (("yes", "Apply permanently", ApplyDeletions(is_confirmed=True)),)
    answer = _buttons(ui, yes, "Leave it" if isinstance(question, DamagedQuestion) else "Cancel")
    return yes[0][2] if answer is None and is_agreed else answer


def _bring_back(clip_index: int, version: int) -> tuple[str, str, Command]:
    return "yes", f"{Icon.UNDO}  Restore version {version}", RestoreVersion(clip_index, version)


def _buttons(ui: UiState, yes: Sequence[tuple[str, str, Command]], no: str) -> Command | None:
    """Side by side, the first one standing out."""
    answer: Command | None = None
    imgui.separator()
    imgui.spacing()
    width = (imgui.get_content_region_avail().x - 8 * len(yes)) / (len(yes) + 1)
    for place, (name, label, command) in enumerate(yes):
        size = ImVec2(width, BUTTON_HEIGHT)
        if primary_button(label, size, ui) if place == 0 else imgui.button(label, size):
            answer = command
        ui.mark(f"question.{name}")
        imgui.same_line(0, 8)
    if imgui.button(no, ImVec2(width, BUTTON_HEIGHT)):
        answer = CloseQuestion()
    ui.mark("question.no")
    return answer


# ---- words -----------------------------------------------------------------------------------------------------


def clip_question_texts(question: ClipQuestion) -> list[str]:
    """Text of the dialog, paragraph by paragraph."""
    match question:
        case CutQuestion():
            return _cut_texts(question)
        case RoomQuestion():
            them = "1 file of a clip" if question.n_clips == 1 else f"{question.n_clips} files of clips"
            return [
                f"Delete {question.words}: {them}, {size_text(question.n_bytes / 1e6)}.",
                "This cannot be undone.",
            ]
        case DamagedQuestion():
            return _damage_texts(question)
        case DeletionsQuestion():
            return _deletions_texts(question)


def _cut_texts(question: CutQuestion) -> list[str]:
    texts = []
    if question.n_unused:
        them = "1 trained clip" if question.n_unused == 1 else f"{question.n_unused} trained clips"
        texts.append(f"{them} will no longer be used. Undo brings {'it' if question.n_unused == 1 else 'them'} back.")
    if question.outdated:
        n = len(question.outdated)
        them = "1 other clip" if n == 1 else f"{n} other clips"
        texts.append(f"{them} will be out of date until trained again.")
    if question.seconds is not None:
        texts.append(f"Training what is missing will take about {duration_text(question.seconds)}.")
    return texts


def _deletions_texts(question: DeletionsQuestion) -> list[str]:
    clips = "1 clip" if question.n_clips == 1 else f"{question.n_clips} clips"
    texts = [
        f"{clips} will be rewritten without {question.n_anchors:,} anchors. The picture does not change.",
        "The present clips are kept as versions; restoring one brings its anchors back.",
        "Edits that hide, or delete only in some frames or only some Gaussians of an anchor, stay in the stack.",
    ]
    if question.n_untrained:
        n = question.n_untrained
        them = "1 clip is" if n == 1 else f"{n} clips are"
        texts.append(
            f"{them} not trained: all deleting edits stay, and so do the anchors that such a clip would inherit."
        )
    return texts


def _damage_texts(question: DamagedQuestion) -> list[str]:
    texts = [f"Clip {question.clip_index} is finished, but cannot be read. {question.reason}"]
    if question.version is not None:
        texts.append(f"An earlier version can be restored: {question.version}, {question.version_text}.")
    else:
        texts.append(f"No earlier version can be restored. {question.why_no_version}")
    cost = "" if question.seconds is None else f" Training it again takes about {duration_text(question.seconds)}."
    texts.append(f'The damaged file moves to the project\'s folder "damaged" either way.{cost}')
    if question.outdated:
        n = len(question.outdated)
        them = "1 clip was" if n == 1 else f"{n} clips were"
        texts.append(f"{them} trained on it, and cannot be shown without the file that is damaged.")
    return texts
