"""What is asked for a page that plays the scene in a browser."""

from __future__ import annotations

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import Job
from app.export.forms.form import Answers, Form, Option

_DATA = (("", "Depending on size"), ("file", "In the page"), ("folder", "In a folder beside it"))
_DATA_TIPS = {
    "": "In the page up to 150 MB, in a folder above that",
    "folder": "Loaded clip by clip as it plays; the folder has to stay beside the page",
}


def _options(context: ExportContext, choices: ExportChoices) -> tuple[Option, ...]:
    return (Option("data", "Scene", _DATA, _DATA_TIPS),)


def _job(answers: Answers) -> Job:
    from app.export.player_job import PlayerJob

    has_folder = {"file": False, "folder": True}.get(answers["data"])
    return PlayerJob(answers.out, answers.job_frames, has_folder, answers.has_edits)


PLAYER = Form(
    kind="player",
    about="A page that plays the scene in a browser, to be turned by hand; it works without a network.",
    options=_options,
    suffix=lambda answers: ".html",
    make_job=_job,
)
