"""SequenceJob: all frames in one file of Gaussians over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

from app.export.jobs.job import EDITS, FRAMES, OBJECT, SOUND, TIMING, ExportJob, option
from app.export.jobs.placing import SCALE, SCENE_UP, UP, Vector, asked_up
from app.export.jobs.question import Question
from app.export.picked_frames import PickedFrames
from engine.errors import ProjectError
from engine.export.sequences.table import SEQUENCES

if TYPE_CHECKING:
    from app.export.jobs.answers import Answers


class SequenceJob(ExportJob, frozen=True):
    """An export of Gaussians over time to a file."""

    kind: ClassVar[str] = "sequence"
    title: ClassVar[str] = "4D file"
    about: ClassVar[str] = "All frames in one file, for players of 4D scenes. Each export is read back and measured."
    work: ClassVar[str] = "app.export.sequences.sequence_job"
    needs_trained: ClassVar[bool] = True

    format: Annotated[
        str,
        option("What is written", "Format", answers={name: (row.title, row.use) for name, row in SEQUENCES.items()}),
    ] = "4dgs"
    frames: Annotated[PickedFrames | None, FRAMES] = None
    up: Annotated[str | None, UP] = None
    scale: Annotated[float | None, SCALE] = None
    scene_up: Annotated[Vector | None, SCENE_UP] = None
    sound: Annotated[str | None, SOUND] = None
    has_edits: Annotated[bool, EDITS] = True
    object: Annotated[str | None, OBJECT] = None
    has_timing: Annotated[bool, TIMING] = True

    @classmethod
    def suffix(cls, format_name: str) -> str:
        """See `ExportJob`."""
        return SEQUENCES[format_name].suffix if format_name in SEQUENCES else ""

    @classmethod
    def asked(cls, questions: dict[str, Question], answers: Answers) -> dict[str, Question]:
        """Sound is asked for where the format holds some and there is some; the usual axis is that of the format."""
        kind = SEQUENCES[questions["format"].chosen(answers.choices)]
        if not (answers.context.has_videos and kind.has_sound):
            del questions["sound"]
        questions["up"] = asked_up(questions["up"], kind)
        return questions

    def check(self) -> None:
        """Check that its entries go together. Raises ProjectError."""
        if self.sound is not None and not SEQUENCES[self.format].has_sound:
            raise ProjectError(f"{SEQUENCES[self.format].title} cannot hold sound.", hint="Leave the sound out.")
