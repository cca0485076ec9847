"""A format and a kind of export are declared once: every layer has them then."""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import pytest

from app.cli import export_command as command
from app.cli.cli import build_parser
from app.command_text.job_command import export_command
from app.export.export_choices import ExportChoices
from app.export.jobs.answers import Answers
from app.export.jobs.job import EDITS, ExportJob, option
from app.export.jobs.table import KINDS, named_job
from engine.setting import Flag
from tests.app.export.test_export_choices import CONTEXT
from tests.documents.exports import export_tables

ROOT = Path(__file__).resolve().parents[3]


class KiteJob(ExportJob, frozen=True):
    """A made-up kind of export."""

    kind: ClassVar[str] = "kites"
    title: ClassVar[str] = "Kites"
    about: ClassVar[str] = "A kite per frame."
    work: ClassVar[str] = "app.export.kites_job"
    is_prefixed: ClassVar[bool] = True

    format: Annotated[
        str, option("What is written", "Format", answers={"paper": ("Paper", "light"), "silk": ("Silk", "strong")})
    ] = "paper"
    tail: Annotated[
        float | None,
        option(
            "Length of the tail",
            label="Tail",
            low=0.5,
            high=9.0,
            none="as long as the line",
            titles={"": "-", "2": "2"},
        ),
    ] = None
    is_loud: Annotated[
        bool,
        option("It hums", label="Sound", titles={"false": "No", "true": "Hums"}, flags=(Flag("--hum", constant=True),)),
    ] = False
    has_edits: Annotated[bool, EDITS] = True


@pytest.fixture
def kites(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "kites", KiteJob)


@pytest.mark.usefixtures("kites")
def test_a_kind_of_export_is_in_every_layer(tmp_path: Path):
    job = KiteJob(tmp_path / "k", "silk", 2.0, is_loud=True, has_edits=False)
    entries: dict[str, Any] = {"tail": 2.0, "is_loud": True, "has_edits": False}
    assert named_job("kites-silk", job.out, **entries) == job
    line = export_command(tmp_path, job).shell(is_windows=False)
    assert "--format kites-silk" in line
    assert line.endswith("--tail 2 --hum --without-edits")
    options = build_parser(["export"]).parse_args(shlex.split(line)[1:])
    command.check_options(options)
    assert command.job_of(options, SimpleNamespace()) == job
    answered = (("format", "silk"), ("tail", "2"), ("is_loud", "true"))
    choices = ExportChoices(kind="kites", out=str(job.out))
    for name, value in answered:
        choices = choices.with_answer(name, value)
    answers = Answers(CONTEXT, choices)
    assert [question.label for question in answers.questions] == ["Format", "Tail", "Sound"]
    assert answers.make_job() == KiteJob(job.out, "silk", 2.0, is_loud=True)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert "length of the tail (default: as long as the line)" in " ".join(parser.format_help().split())
    assert "| `--hum` | `is_loud` | `false` | It hums |" in export_tables()


WITH_A_FORMAT = """
from engine.export.formats.table import FORMATS
FORMATS["kite"] = FORMATS["ply"]._replace(title="Kite", use="for windy days")
from pathlib import Path
from app.cli.cli import build_parser
from app.cli.export_command import job_of
from app.command_text.job_command import export_command
from app.export.export_choices import ExportChoices
from app.export.jobs.answers import Answers
from app.export.jobs.table import named_job
from tests.app.export.test_export_choices import CONTEXT
from tests.documents.exports import export_tables
job = named_job("kite", "/out")
arguments = export_command(Path("/p"), job).arguments
assert job_of(build_parser(["export"]).parse_args(arguments), None) == job
answers = Answers(CONTEXT, ExportChoices(out="/out").with_answer("format", "kite"))
assert answers.make_job() == job and answers.title == "Gaussians, Kite"
assert answers.questions[0].tips["kite"] == "For windy days"
assert "`kite`: for windy days" in export_tables()
"""


@pytest.mark.slow
def test_a_format_of_gaussians_is_in_every_layer():
    subprocess.run([sys.executable, "-c", WITH_A_FORMAT], check=True, cwd=ROOT, timeout=600)


@pytest.mark.parametrize(
    ("word", "files"),
    [
        (r'"(compressed-ply|sog)"', ["engine/export/formats/table.py"]),
        (r"\bcompressed_ply\b", ["engine/export/formats/table.py"]),
        (r"\bPlayerJob\b", ["app/export/jobs/player.py", "app/export/jobs/table.py", "app/export/player_job.py"]),
        (r"\bMetricsJob\b", ["app/export/jobs/metrics.py", "app/export/jobs/table.py", "app/export/metrics_job.py"]),
    ],
)
def test_how_many_files_know_it(word: str, files: list[str]):
    """A format is its own file and the table; a kind of export its declaration, its work and the table."""
    sources = [path for part in ("app", "engine", "ui") for path in (ROOT / part).rglob("*.py")]
    assert sorted(str(path.relative_to(ROOT)) for path in sources if re.search(word, path.read_text("utf-8"))) == files
