"""Job: the base of what exports are asked for. Everything about an option stands in its annotation, once.

A job is a frozen struct. The command line, the form of the window, the text to copy, the options of scripts and the
tables of the documents follow from its fields (engine.setting). Its work is a module with two functions, imported once
it is needed:

    estimate(opened, job) -> ExportEstimate   quick, reads no more than headers; raises EngineError where it cannot be
    run(opened, job, report) -> ExportResult  does the work; what `report` raises ends it, and then nothing is left
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

from msgspec import Meta
from msgspec.structs import force_setattr

from app.export.export_progress import ExportEstimate, ExportResult, Report
from app.export.jobs.question import Question
from app.export.picked_frames import PickedFrames
from engine.own_modules import import_own
from engine.setting import Declared, Flag, setting, settings_of

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject
    from app.export.jobs.answers import Answers


def option(
    meaning: str, label: str = "", *, answers: Mapping[str, tuple[str, str]] | None = None, **declared: Any
) -> Meta:
    """The annotation of an option; see `engine.setting.setting`.

    Args:
        answers: Words it may be, each with the window's name of it and its meaning, which may be empty.
    """
    if answers is not None:
        declared["choices"] = {word: means for word, (_, means) in answers.items()}
        declared["titles"] = {word: title for word, (title, _) in answers.items()}
    return setting("", meaning, label=label, **declared)


FRAMES = option("Frames of the capture", none="all trained frames")
EDITS = option(
    "Whether the edits of the project are applied",
    "Edits",
    titles={"true": "Applied", "false": "Left out"},
    flags=(Flag("--without-edits", "Left out: the scene without them", constant=False),),
)

OBJECT = option(
    "Only this object, without the rest of the scene",
    "Object",
    none="the whole scene",
    titles={"": "Whole scene", "*": "Only {}"},
    names="objects",
    like="NAME",
    flags=(Flag("--object"),),
)
TIMING = option(
    "Whether the timing of the take is followed",
    "Time",
    titles={"true": "As edited", "false": "As captured"},
    flags=(Flag("--as-captured", "The take as captured, without its timing", constant=False),),
)
SOUND = option(
    "Adds the sound recorded by this camera",
    "Sound",
    titles={"": "None", "*": "Camera {}"},
    names="cameras",
    like="CAMERA",
)


class JobModule(Protocol):
    """The functions of the module with the work of a job."""

    def estimate(self, opened: TrainedProject, job: Any) -> ExportEstimate:
        """Estimate what will be written. Raises EngineError where it cannot be."""
        ...

    def run(self, opened: TrainedProject, job: Any, report: Report) -> ExportResult:
        """Write the export. Raises EngineError, and as `report` does."""
        ...


class ExportJob(Declared, frozen=True, tag=True):
    """The request. Raises ProjectError for a value that an option may not have.

    Attributes:
        out: The file or folder to write.
        kind: Name of the kind of export.
        title: The user's word for it.
        about: Its purpose, in a sentence.
        work: Module with its work.
        command: The command, and method of a script, that takes it.
        is_prefixed: Whether the kind stands in front of its formats where those of all kinds are listed.
        needs_trained: Whether all chosen frames have to be trained.
        has_step: Whether it can be every so many frames.
    """

    out: Path

    kind: ClassVar[str]
    title: ClassVar[str]
    about: ClassVar[str]
    work: ClassVar[str]
    command: ClassVar[str] = "export"
    is_prefixed: ClassVar[bool] = False
    needs_trained: ClassVar[bool] = False
    has_step: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if isinstance(frames := getattr(self, "frames", None), range):  # as scripts usually have them
            force_setattr(self, "frames", PickedFrames.of(frames))
        super().__post_init__()

    @property
    def applies_edits(self) -> bool:
        """Whether what is written has the edits of the project in it."""
        return bool(getattr(self, "has_edits", False))

    @property
    def follows_timing(self) -> bool:
        """Whether what is written plays as the take is edited."""
        return bool(getattr(self, "has_timing", False))

    @classmethod
    def load(cls) -> JobModule:
        """Import its work."""
        return cast("JobModule", import_own(cls.work))

    @classmethod
    def takes(cls, name: str) -> bool:
        """Whether it has such an option."""
        return name in settings_of(cls)

    @classmethod
    def formats(cls) -> dict[str, str]:
        """Its names in the list of the formats of all kinds, each with the format that it stands for."""
        if not cls.takes("format"):
            return {cls.kind: ""}
        prefix = f"{cls.kind}-" if cls.is_prefixed else ""
        return {f"{prefix}{name}": name for name in settings_of(cls)["format"].choices}

    @property
    def format_name(self) -> str:
        """The name in `formats` of the job's format."""
        return next(name for name, value in self.formats().items() if value == getattr(self, "format", ""))

    @classmethod
    def suffix(cls, format_name: str) -> str:
        """Of the file in this format, with its dot; empty where a folder is written."""
        return ""

    @classmethod
    def asked(cls, questions: dict[str, Question], answers: Answers) -> dict[str, Question]:
        """The form's questions, chosen from those that its options alone lead to."""
        return questions

    @classmethod
    def entries(cls, answers: Answers) -> dict[str, Any]:
        """Entries that follow from the answers to `asked` where an answer is not the value of one option."""
        return {}
