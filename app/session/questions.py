"""Questions that the user is asked before something is done: plain values with all that the answer depends on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.capture_report import CaptureReport
from app.project.opening.opening_answers import OpeningAnswers
from app.project.opening.project_choices import AS_USUAL, ProjectChoices
from app.project.recents import RecentProject
from app.session.clips.clip_questions import ClipQuestion
from app.session.files.file_questions import FileQuestion
from engine.capture.writers.capture_json import Corrections


@dataclass(frozen=True, slots=True)
class RetrainQuestion:
    """Is a clip to be trained again, although it is finished?

    Attributes:
        clip_index: The clip.
        is_damaged: Its file cannot be read, and is replaced for good.
        reason: The damage; empty for a good one.
        held_out_psnr, held_out_whole: Of the finished clip, dB, and its basis, see ClipRecord; None where
            not measured or damaged.
        outdated: Clips that are good now and will be out of date with another result of this one.
        seconds: Expected for training it again: those of the last time, or the average of the clips; None where nothing
            was recorded.
        is_average: Whether that is an average.
        outdated_seconds: Likewise for training all of `outdated` again.
        resume_step: The step of an earlier try that it continues from; None when it starts from the beginning.
        settings: For this clip alone; see commands.TrainClip.
    """

    clip_index: int
    is_damaged: bool
    reason: str
    held_out_psnr: float | None
    outdated: tuple[int, ...]
    seconds: float | None
    is_average: bool
    outdated_seconds: float | None
    resume_step: int | None
    settings: tuple[tuple[str, int | float | str | bool], ...] = ()
    held_out_whole: bool = False


@dataclass(frozen=True, slots=True)
class ProjectQuestion:
    """Which of the projects of a capture is to be opened, or a new one made?

    Attributes:
        capture: Folder of the capture.
        choices: The projects there are, latest first.
        follow_links: Whether the user allows the capture's files to lie outside of its folder.
        opened: Folder of the project that is open; None where none is.
        how: In which way it is opened.
    """

    capture: str
    choices: tuple[RecentProject, ...]
    follow_links: bool = False
    opened: Path | None = None
    how: ProjectChoices = AS_USUAL


@dataclass(frozen=True, slots=True)
class LeaveQuestion:
    """Is the training to be stopped, because another project was opened?

    Attributes:
        name: Of the other project.
        clip_index: The clip that trains.
        step, n_steps: How far it is; zeros before its first step.
        n_waiting: Clips that wait.
        n_beside: Others that train here.
    """

    name: str
    clip_index: int
    step: int
    n_steps: int
    n_waiting: int
    n_beside: int = 0


@dataclass(frozen=True, slots=True)
class StartOverQuestion:
    """Is everything that is trained to be discarded, to start over with other settings?

    Attributes:
        project: Its folder.
        discards: In words, as "2 trained clips (4:10 of training), 3.1 MB"; empty for nothing.
        presets: Names to choose from.
        preset: The one that the settings begin with now.
        is_working: It is being done.
    """

    project: Path
    discards: str
    presets: tuple[str, ...]
    preset: str
    is_working: bool = False


@dataclass(frozen=True, slots=True)
class SettingsQuestion:
    """Which settings is a clip to be trained with, instead of the project's?

    Attributes:
        clip_index: The clip.
        settings: Those that may be others in this clip, as they are now.
        retrain: The question before a finished clip is trained again; None where it is not finished.
        has_progress: Whether progress from before a stop is given up by it.
    """

    clip_index: int
    settings: tuple[OwnSetting, ...]
    retrain: RetrainQuestion | None
    has_progress: bool


@dataclass(frozen=True, slots=True)
class OwnSetting:
    """A setting as it is offered for one clip.

    Attributes:
        value: Set or derived.
        choices: Allowed values, where these are words.
        help_text: Effect and allowed values.
    """

    name: str
    label: str
    value: int | float | str | bool
    choices: tuple[str, ...] = ()
    help_text: str = ""


@dataclass(frozen=True, slots=True)
class CorrectionQuestion:
    """Are corrections to be written into the capture, although the open project will not fit it then?

    Attributes:
        capture: Folder of the capture, which gets a capture.json.
        words: The corrections, as "Exclude cam07".
        corrections: The same for the file.
        project: Folder of the project that is open.
        has_progress: Whether the project has progress.
    """

    capture: str
    words: str
    corrections: Corrections
    project: str
    has_progress: bool


@dataclass(frozen=True, slots=True, eq=False)
class OpeningPage:
    """A capture without a project, and the questions about it.

    Attributes:
        report: On the capture.
        answers: Offered ones.
        is_new_project: Whether there are projects of it already, and another one was asked for.
        follow_links: Whether its files may lie outside of its folder.
        folder: Where the project would be made.
    """

    report: CaptureReport
    answers: OpeningAnswers
    is_new_project: bool
    follow_links: bool
    folder: Path = Path()


Question = (
    RetrainQuestion
    | SettingsQuestion
    | ProjectQuestion
    | LeaveQuestion
    | StartOverQuestion
    | CorrectionQuestion
    | ClipQuestion
    | FileQuestion
)


def retrain_question(catalog: ClipCatalog, clip_index: int) -> RetrainQuestion:
    """The question before a finished or damaged clip is trained again."""
    record, outdated = catalog[clip_index], catalog.outdated_by(clip_index)
    known = [seconds for index in range(len(catalog)) if (seconds := catalog[index].seconds) is not None]
    average = sum(known) / len(known) if known else None
    times = [average if (seconds := catalog[index].seconds) is None else seconds for index in outdated]
    seconds = average if record.seconds is None else record.seconds
    if seconds is not None and record.resume_step is not None and record.resume_n_steps:
        seconds *= 1.0 - record.resume_step / record.resume_n_steps
    return RetrainQuestion(
        clip_index=clip_index,
        is_damaged=record.state == "damaged",
        reason=record.reason,
        held_out_psnr=record.held_out_psnr,
        held_out_whole=record.held_out_whole,
        outdated=tuple(outdated),
        seconds=seconds,
        is_average=record.seconds is None,
        outdated_seconds=None if average is None else sum(time for time in times if time is not None),
        resume_step=record.resume_step,
    )


class Asked:
    """The question that the user has to answer now.

    Attributes:
        question: None while there is nothing to ask.
    """

    def __init__(self) -> None:
        self.question: Question | None = None

    def put(self, question: Question | None) -> None:
        """Ask this and nothing else; None withdraws the question."""
        self.question = question

    def put_if_free(self, question: Question) -> None:
        """Ask something that no command asked for: a question that is up already comes first."""
        if self.question is None:
            self.question = question

    def take(self) -> Question | None:
        """The question, which is withdrawn."""
        taken, self.question = self.question, None
        return taken
