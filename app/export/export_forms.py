"""What the export dialog asks for each kind of export, and the job that the answers make: one row of a table each.

An option is a question with a few named answers; what all kinds share, frames and place, is asked by the dialog itself.
Modules of the jobs are imported where a job is made, because they bring what only the work needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import KINDS, Job

Value = TypeVar("Value", bound=str)


@dataclass(frozen=True, slots=True)
class Option:
    """One question.

    Attributes:
        name: As in ExportChoices.answers.
        label: In front of the answers.
        values: Value and words of each answer; the first is the usual one.
        tips: What the answers mean, by value; none where the words are enough.
    """

    name: str
    label: str
    values: tuple[tuple[str, str], ...]
    tips: dict[str, str] = field(default_factory=dict)

    def chosen(self, choices: ExportChoices) -> str:
        """The answer, the usual one where there is none or it is none of the values."""
        answer = choices.answer(self.name)
        return answer if answer in dict(self.values) else self.values[0][0]


@dataclass(frozen=True, slots=True)
class Form:
    """The questions of one kind.

    Attributes:
        kind: One of the kinds of app.export.export_jobs.
        about: What it is for, in a sentence.
        options: Of an open project and what was chosen so far.
        suffix: Of the file, with its dot; empty where a folder is written.
        make_job: Of the answers.
        has_frames: Whether frames are asked for.
        needs_trained: Whether all frames have to be trained.
    """

    kind: str
    about: str
    options: Callable[[ExportContext, ExportChoices], tuple[Option, ...]]
    suffix: Callable[[Answers], str]
    make_job: Callable[[Answers], Job]
    has_frames: bool = True
    needs_trained: bool = True


@dataclass(frozen=True, slots=True)
class Answers:
    """Everything that a job is made of."""

    context: ExportContext
    choices: ExportChoices

    def __getitem__(self, option: str) -> str:
        options = FORMS[self.choices.kind].options(self.context, self.choices)
        return next(one for one in options if one.name == option).chosen(self.choices)

    def one_of(self, values: Sequence[Value], option: str) -> Value:
        """The answer as one of the values that a job takes."""
        return next(value for value in values if value == self[option])

    @property
    def frames(self) -> range:
        """The chosen frames."""
        return self.context.frames(self.choices.frames, self.choices.step)

    @property
    def out(self) -> Path:
        """The chosen file or folder."""
        return Path(self.choices.out).expanduser()

    @property
    def suffix(self) -> str:
        """Of the file; empty where a folder is written."""
        return FORMS[self.choices.kind].suffix(self)

    @property
    def title(self) -> str:
        """What is exported, in a few words: the kind and its first answer."""
        form = FORMS[self.choices.kind]
        options = form.options(self.context, self.choices)
        words = [dict(options[0].values)[options[0].chosen(self.choices)]] if options else []
        return ", ".join([KINDS[self.choices.kind].title, *words])


def _metrics(answers: Answers) -> Job:
    from app.export.metrics_job import METRICS_FORMATS, MetricsJob

    return MetricsJob(answers.out, answers.one_of(METRICS_FORMATS, "format"), answers.frames)


def _metrics_options(context: ExportContext, choices: ExportChoices) -> tuple[Option, ...]:
    tips = {
        "csv": "A table for a spreadsheet: a row per clip, frame and camera",
        "json": "The same with neighbouring frames, and all settings of every clip",
    }
    return (Option("format", "Format", (("csv", "CSV"), ("json", "JSON")), tips),)


def _cameras(answers: Answers) -> Job:
    from app.export.cameras_job import CAMERAS_FORMATS, CamerasJob

    return CamerasJob(answers.out, answers.one_of(CAMERAS_FORMATS, "format"))


def _cameras_options(context: ExportContext, choices: ExportChoices) -> tuple[Option, ...]:
    tips = {"colmap": "A folder with sparse/0, as text", "transforms": "A folder with transforms.json of nerfstudio"}
    return (Option("format", "Format", (("colmap", "COLMAP"), ("transforms", "transforms.json")), tips),)


FORMS: dict[str, Form] = {
    form.kind: form
    for form in (
        Form(
            "metrics",
            "Every figure that was measured, with the settings it was reached with.",
            _metrics_options,
            lambda answers: f".{answers['format']}",
            _metrics,
            needs_trained=False,
        ),
        Form(
            "cameras",
            "Where the cameras of the capture stand and what their lenses do.",
            _cameras_options,
            lambda answers: "",
            _cameras,
            has_frames=False,
        ),
    )
}
"""The forms of all kinds, by kind."""
