"""Answers: what was chosen in the form of an export, with the questions that it answers, and the job that it makes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from app.export.export_choices import ExportChoices, ExportContext
from app.export.jobs.job import ExportJob
from app.export.jobs.question import Question, question_about
from app.export.jobs.table import KINDS
from app.export.picked_frames import PickedFrames
from engine.setting import Setting, settings_of

Part = TypeVar("Part", bound=msgspec.Struct)


@dataclass(frozen=True, slots=True)
class Answers:
    """Everything that a job is made of."""

    context: ExportContext
    choices: ExportChoices

    @property
    def job_type(self) -> type[ExportJob]:
        """The declaration of the chosen kind of export."""
        return KINDS[self.choices.kind]

    @property
    def questions(self) -> tuple[Question, ...]:
        """The questions of the form, in order."""
        return tuple(self.job_type.asked(self._declared(), self).values())

    def _declared(self) -> dict[str, Question]:
        """The questions that the options lead to, those about edits and timing where there are any."""
        declared = self._settings()
        return {
            name: question_about(setting, self.context)
            for name, setting in declared.items()
            if setting.label
            and (name != "has_edits" or self.context.has_edits)
            and (name != "has_timing" or self.context.has_timing)
            and all(
                question_about(declared[other], self.context).chosen(self.choices) in values
                for other, values in setting.shown_with.items()
            )
        }

    def _settings(self) -> dict[str, Setting]:
        """The options, each followed by those that it consists of."""
        found: dict[str, Setting] = {}
        for name, setting in settings_of(self.job_type).items():
            found |= {name: setting, **setting.inner}
        return found

    def __getitem__(self, name: str) -> str:
        """The answer to a question; empty where it is not asked."""
        return next((one.chosen(self.choices) for one in self.questions if one.name == name), "")

    def make_job(self) -> ExportJob:
        """The job. Raises ProjectError where an answer cannot be."""
        asked = {question.name: text for question in self.questions if (text := question.chosen(self.choices))}
        entries: dict[str, Any] = {"frames": self._job_frames} if self.job_type.takes("frames") else {}
        entries |= self.job_type.entries(self)
        for name, setting in settings_of(self.job_type).items():
            if name in asked and name not in entries:
                entries[name] = setting.parse(asked[name])
        return self.job_type(self.out, **entries)

    def part(self, kind: type[Part]) -> Part:
        """An entry that consists of options of its own."""
        declared = settings_of(kind)
        return kind(**{name: setting.parse(text) for name, setting in declared.items() if (text := self[name])})

    @property
    def frames(self) -> PickedFrames:
        """The chosen frames."""
        return self.context.frames(self.choices.frames, self._step)

    @property
    def _job_frames(self) -> PickedFrames | None:
        """The same as jobs take them: None for all that are trained."""
        return None if self.choices.frames == "all" and self._step == 1 else self.frames

    @property
    def _step(self) -> int:
        return self.choices.step if self.job_type.has_step else 1

    @property
    def out(self) -> Path:
        """The chosen file or folder."""
        return Path(self.choices.out).expanduser()

    @property
    def suffix(self) -> str:
        """Of the file; empty where a folder is written."""
        return self.job_type.suffix(self["format"])

    @property
    def title(self) -> str:
        """The export in a few words: the kind and its format."""
        words = [dict(question.values)[self["format"]] for question in self.questions if question.name == "format"]
        return ", ".join([self.job_type.title, *words])
