"""CamerasJob: the cameras of a project's capture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from app.export.jobs.job import ExportJob, option
from app.export.jobs.placing import SCALE, SCENE_UP, USD_UP, Vector, asked_up
from app.export.jobs.question import Question
from engine.errors import ProjectError
from engine.export.sequences.table import SEQUENCES

if TYPE_CHECKING:
    from app.export.jobs.answers import Answers

PLACED = "up", "scale", "scene_up"
"""Options of the format that says which way is up and how long a unit is."""


class CamerasJob(ExportJob, frozen=True):
    """An export of cameras to a new or empty folder."""

    kind: ClassVar[str] = "cameras"
    title: ClassVar[str] = "Cameras"
    about: ClassVar[str] = "Poses and lenses of the capture's cameras."
    work: ClassVar[str] = "app.export.cameras_job"
    is_prefixed: ClassVar[bool] = True

    format: Annotated[
        Literal["colmap", "transforms", "usd"],
        option(
            "What is written",
            "Format",
            answers={
                "colmap": ("COLMAP", "a folder with COLMAP's sparse model, as text"),
                "transforms": ("transforms.json", "a folder with transforms.json of nerfstudio"),
                "usd": ("USD", "a folder with cameras.usda, with all camera paths, for compositing"),
            },
        ),
    ] = "colmap"
    up: Annotated[str | None, USD_UP] = None
    scale: Annotated[float | None, SCALE] = None
    scene_up: Annotated[Vector | None, SCENE_UP] = None

    @classmethod
    def asked(cls, questions: dict[str, Question], answers: Answers) -> dict[str, Question]:
        """Where cameras lie is asked for USD, as for files of Gaussians."""
        if questions["format"].chosen(answers.choices) == "usd":
            questions["up"] = asked_up(questions["up"], SEQUENCES["usd"])
        else:
            for name in PLACED:
                del questions[name]
        return questions

    def check(self) -> None:
        """Check that its entries go together. Raises ProjectError."""
        given = [name for name in PLACED if getattr(self, name) is not None]
        if given and self.format != "usd":
            flag = f"--{given[0].replace('_', '-')}"
            raise ProjectError(
                f"{flag} does not apply to {self.format_name}.", hint="Leave it out, or use cameras-usd."
            )
