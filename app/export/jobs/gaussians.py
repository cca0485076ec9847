"""GaussiansJob: a file of Gaussians per frame."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from app.export.jobs.job import EDITS, FRAMES, TIMING, ExportJob, option
from app.export.picked_frames import PickedFrames
from engine.export.formats.table import FORMATS
from engine.export.world import AXES
from engine.setting import Flag, Writing, value_text

WrittenPart = Literal["all", "static", "moving", "split"]
Vector = tuple[float, float, float]


def _read_vector(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return x, y, z


def _vector_text(vector: Vector) -> str:
    return " ".join(map(value_text, vector))


_SCENE_UPS = {"": "As in the project"} | {_vector_text(axis): name for name, axis in AXES.items()}


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
    up: Annotated[
        str | None,
        option(
            "Turns the scene so that up points along this axis of the files",
            "Up axis",
            none="as in the capture",
            choices=dict.fromkeys(AXES, ""),
            titles={"": "As in the capture", "+y": "+y", "-y": "-y", "+z": "+z", "-z": "-z"},
            flags=(
                Flag("--up", "Turns the scene so that this axis points up", prefix="+"),
                Flag("--down", "Turns the scene so that this axis points down", prefix="-"),
            ),
        ),
    ] = None
    scale: Annotated[
        float | None,
        option(
            "Units of the files per unit of the capture",
            "Scale",
            low=1e-6,
            high=1e6,
            none="metres where the project says how long a unit is, else as in the capture",
            titles={"": "Metres, where the scale is known"}
            | {size: size for size in ("1", "0.001", "0.01", "10", "100", "1000")},
            like="S",
        ),
    ] = None
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
    scene_up: Annotated[
        Vector | None,
        option(
            "Which way is up in the capture, for the up axis of the files",
            "Up in the capture",
            none="set in the project, else derived from the cameras",
            titles=_SCENE_UPS,
            writing=Writing("X Y Z", "three numbers", _read_vector, _vector_text),
        ),
    ] = None
    has_edits: Annotated[bool, EDITS] = True
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
