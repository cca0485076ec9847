"""GaussiansJob: a file of Gaussians per frame."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from app.export.jobs.job import EDITS, FRAMES, OBJECT, TIMING, ExportJob, option
from app.export.jobs.placing import SCALE, SCENE_UP, UP, Vector
from app.export.picked_frames import PickedFrames
from engine.export.formats.table import FORMATS

WrittenPart = Literal["all", "static", "moving", "split"]


class GaussiansJob(ExportJob, frozen=True):
    """An export of Gaussians to a new or empty folder of files."""

    kind: ClassVar[str] = "gaussians"
    title: ClassVar[str] = "Gaussians"
    about: ClassVar[str] = (
        "A folder with a file per frame, for viewers, editors and engines. Each export is read back and measured."
    )
    work: ClassVar[str] = "app.export.gaussians.gaussians_job"
    needs_trained: ClassVar[bool] = True

    format: Annotated[
        str, option("What is written", "Format", answers={name: (row.title, row.use) for name, row in FORMATS.items()})
    ] = "ply"
    frames: Annotated[PickedFrames | None, FRAMES] = None
    part: Annotated[
        WrittenPart,
        option(
            "Which part of the scene is written",
            "Part",
            answers={
                "all": ("Whole scene", ""),
                "static": ("Static", "what stands still, once for as long as it does not change"),
                "moving": ("Moving", "what moves, in a file per frame"),
                "split": ("Both, separately", "what stands still once, and what moves in a file per frame"),
            },
        ),
    ] = "all"
    up: Annotated[str | None, UP] = None
    scale: Annotated[float | None, SCALE] = None
    axes: Annotated[
        Literal["ply", "rub"],
        option(
            "Axes of the files",
            "Axes",
            answers={
                "ply": ("As in .ply files", "as in .ply files"),
                "rub": ("For Niantic's programs", "y and z reversed, as Niantic's programs expect .spz"),
            },
            shown_with={"format": ("spz",)},
        ),
    ] = "ply"
    scene_up: Annotated[Vector | None, SCENE_UP] = None
    has_edits: Annotated[bool, EDITS] = True
    object: Annotated[str | None, OBJECT] = None
    has_timing: Annotated[bool, TIMING] = True
    fields: Annotated[
        Literal["usual", "full"],
        option(
            "What is kept of each Gaussian in a .ply file",
            "Fields",
            answers={
                "usual": ("Standard, 56 bytes each", ""),
                "full": (
                    "Full, 248 bytes each",
                    "normals and f_rest too, all 0, as the reference code of 3D Gaussian Splatting writes, for "
                    "programs that need them",
                ),
            },
            shown_with={"format": ("ply",)},
        ),
    ] = "usual"
