"""What is asked for figures and for cameras."""

from __future__ import annotations

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import Job
from app.export.forms.form import Answers, Form, Option


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


METRICS = Form(
    kind="metrics",
    about="Every figure that was measured, with the settings it was reached with.",
    options=_metrics_options,
    suffix=lambda answers: f".{answers['format']}",
    make_job=_metrics,
    takes_edits=False,
    needs_trained=False,
)
CAMERAS = Form(
    kind="cameras",
    about="Where the cameras of the capture stand and what their lenses do.",
    options=_cameras_options,
    suffix=lambda answers: "",
    make_job=_cameras,
    takes_edits=False,
    has_frames=False,
)
