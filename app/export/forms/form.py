"""Form: the questions of one kind of export as values, and the job that the answers make.

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
from app.export.picked_frames import PickedFrames

WITHOUT = "without"
"""The answer by which edits are left out."""
Value = TypeVar("Value", bound=str)


@dataclass(frozen=True, slots=True)
class Option:
    """One question.

    Attributes:
        name: As in ExportChoices.answers.
        label: In front of the answers.
        values: Value and words of each answer; the first is the usual one.
        tips: What the answers mean, by value; none where the words are enough.
        has_names: Whether words have names in them that the user or the capture gave.
    """

    name: str
    label: str
    values: tuple[tuple[str, str], ...]
    tips: dict[str, str] = field(default_factory=dict)
    has_names: bool = False

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
        has_step: Whether it can be every so many of them.
        takes_edits: Whether edits change what is written.
        needs_trained: Whether all of the frames have to be trained, whatever else was answered.
    """

    kind: str
    about: str
    options: Callable[[ExportContext, ExportChoices], tuple[Option, ...]]
    suffix: Callable[[Answers], str]
    make_job: Callable[[Answers], Job]
    has_frames: bool = True
    has_step: bool = True
    takes_edits: bool = True
    needs_trained: bool = True


EDITS = Option("edits", "Edits", (("", "Applied"), (WITHOUT, "As it was trained")))


@dataclass(frozen=True, slots=True)
class Answers:
    """Everything that a job is made of."""

    form: Form
    context: ExportContext
    choices: ExportChoices

    @property
    def options(self) -> tuple[Option, ...]:
        """The questions."""
        options = self.form.options(self.context, self.choices)
        return (*options, EDITS) if self.form.takes_edits and self.context.has_edits else options

    @property
    def has_edits(self) -> bool:
        """Whether edits are applied."""
        return self[EDITS.name] != WITHOUT

    def __getitem__(self, name: str) -> str:
        """The answer to a question; empty where it is not asked."""
        return next((option.chosen(self.choices) for option in self.options if option.name == name), "")

    def one_of(self, values: Sequence[Value], name: str) -> Value:
        """The answer as one of the values that a job takes; the first where it is none of them."""
        return next((value for value in values if value == self[name]), values[0])

    @property
    def frames(self) -> range | PickedFrames:
        """The chosen frames."""
        return self.context.frames(self.choices.frames, self._step)

    @property
    def job_frames(self) -> range | PickedFrames | None:
        """The same as jobs take them: None for all that are trained."""
        return None if self.choices.frames == "all" and self._step == 1 else self.frames

    @property
    def _step(self) -> int:
        return self.choices.step if self.form.has_step else 1

    @property
    def out(self) -> Path:
        """The chosen file or folder."""
        return Path(self.choices.out).expanduser()

    @property
    def suffix(self) -> str:
        """Of the file; empty where a folder is written."""
        return self.form.suffix(self)

    @property
    def title(self) -> str:
        """What is exported, in a few words: the kind and its format."""
        words = [dict(option.values)[option.chosen(self.choices)] for option in self.options if option.name == "format"]
        return ", ".join([KINDS[self.form.kind].title, *words])
