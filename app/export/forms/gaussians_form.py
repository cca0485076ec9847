"""What is asked for files of Gaussians."""

from __future__ import annotations

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import Job
from app.export.forms.form import Answers, Form, Option

_FORMATS = (
    ("ply", "PLY"),
    ("compressed-ply", "Compressed PLY"),
    ("spz", "SPZ"),
    ("splat", "splat"),
    ("glb", "glTF (.glb)"),
    ("sog", "SOG"),
)
_FORMAT_TIPS = {
    "ply": "Floats, for nearly all programs: SuperSplat, Blender, Unity, Unreal, Open3D and others",
    "compressed-ply": "A third of that, for SuperSplat, PlayCanvas, Spark and Brush",
    "spz": "A quarter of that, for Niantic's programs, Blender, SuperSplat and Spark",
    "splat": "For older viewers in browsers",
    "glb": "glTF 2.0 with KHR_gaussian_splatting",
    "sog": "The smallest, for SuperSplat, PlayCanvas and Spark",
}
_PARTS = (
    ("all", "All of the scene"),
    ("static", "What stands still"),
    ("moving", "What moves"),
    ("split", "Both, apart"),
)
_PART_TIPS = {
    "static": "One file as long as it stays the same",
    "moving": "A file per frame",
    "split": "What stands still once, and what moves in a file per frame",
}
_UPS = (("", "As in the capture"), ("+y", "+y"), ("-y", "-y"), ("+z", "+z"), ("-z", "-z"))
_UP_TIP = "Turns the scene so that what is up in it points along this axis"
_SCALE_TIP = "Units of the files per unit of the capture"
_METRES_TIP = "Metres where the panel Edits says how long a unit of the scene is; else as in the capture"
_AXES = (("ply", "As in .ply files"), ("rub", "As Niantic's programs take them"))
_SCALES = (
    ("", "Metres, where the scale is known"),
    ("1", "1"),
    ("0.001", "0.001"),
    ("0.01", "0.01"),
    ("10", "10"),
    ("100", "100"),
    ("1000", "1000"),
)


def _options(context: ExportContext, choices: ExportChoices) -> tuple[Option, ...]:
    format_ = Option("format", "Format", _FORMATS, _FORMAT_TIPS)
    options = (
        format_,
        Option("part", "Part", _PARTS, _PART_TIPS),
        Option("up", "Up axis", _UPS, {value: _UP_TIP for value, _ in _UPS[1:]}),
        Option("scale", "Scale", _SCALES, {value: _SCALE_TIP for value, _ in _SCALES[1:]} | {"": _METRES_TIP}),
    )
    return (*options, Option("axes", "Axes", _AXES)) if format_.chosen(choices) == "spz" else options


def _job(answers: Answers) -> Job:
    from app.export.gaussian_files import WRITTEN_PARTS
    from app.export.gaussians_job import GaussiansJob

    return GaussiansJob(
        out=answers.out,
        format=answers["format"],
        frames=answers.job_frames,
        part=answers.one_of(WRITTEN_PARTS, "part"),
        up=answers["up"] or None,
        scale=float(answers["scale"]) if answers["scale"] else None,
        axes=answers.one_of(("ply", "rub"), "axes"),
        has_edits=answers.has_edits,
    )


GAUSSIANS = Form(
    kind="gaussians",
    about="A folder with a file per frame, for viewers, editors and engines. Each export is read back and measured.",
    options=_options,
    suffix=lambda answers: "",
    make_job=_job,
)
