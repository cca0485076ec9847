"""Jobs as commands: the command line makes the same job of them, and so does a script."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cli import export_command, render_command, train_command
from app.cli.cli import build_parser
from app.command_text.job_command import export_command as as_command
from app.command_text.job_command import mend_command, training_command, version_command
from app.document.project_settings import ProjectSettings
from app.export.cameras_job import CamerasJob
from app.export.export_jobs import KINDS
from app.export.gaussians_job import GaussiansJob
from app.export.metrics_job import MetricsJob
from app.export.named_jobs import JOB_FORMATS, format_name_of, named_job
from app.export.picked_frames import PickedFrames
from app.export.player_job import PlayerJob
from app.export.video.formats import FORMATS as VIDEO_FORMATS
from app.export.video.job import Turntable, VideoJob
from app.mending.request import MendRequest
from app.scripting import scripted_project
from engine.errors import ProjectError
from engine.export.formats.table import FORMATS as GAUSSIAN_FORMATS
from engine.training.config import parse_overrides

GAPS = PickedFrames((range(0, 4, 2), range(10, 20, 2)), 2)
OUT = Path("/somewhere/it's 100 % out")
JOBS = [
    GaussiansJob(OUT),
    GaussiansJob(OUT, "spz", range(3, 4), axes="rub"),
    GaussiansJob(OUT, "sog", range(0, 20, 3), "split", "-y", 1e-5),
    GaussiansJob(OUT, "glb", GAPS, "moving", "+z", 100.0, scene_up=(0.0, -1.0, 1e-6)),
    PlayerJob(OUT.with_suffix(".html")),
    PlayerJob(OUT.with_suffix(".html"), range(0, 20, 2), True),
    PlayerJob(OUT.with_suffix(".html"), GAPS, False),
    PlayerJob(OUT.with_suffix(".html"), has_edits=False),
    GaussiansJob(OUT, has_edits=False),
    VideoJob(OUT, "png", camera="cam", has_edits=False),
    MetricsJob(OUT.with_suffix(".json"), "json", range(20)),
    MetricsJob(OUT.with_suffix(".csv")),
    CamerasJob(OUT),
    CamerasJob(OUT, "transforms"),
    VideoJob(OUT.with_suffix(".mp4"), "mp4", camera="two words, and a comma"),
    VideoJob(OUT, "png", camera="-x", is_transparent=True, size=(64, 48), supersampling=2, features="static"),
    VideoJob(OUT.with_suffix(".webm"), "webm", path='it\'s "mine"', frames=(3, 9), speed=0.25, fps=24.0, sound="-x"),
    VideoJob(OUT.with_suffix(".mp4"), "mp4", turntable=Turntable(-1.0, 1e-5, 2.5), hold=3.0, background=(1, 2, 255)),
    VideoJob(OUT, "exr", turntable=Turntable(), shows="depth"),
]


def kind_of(job: Any) -> str:
    return next(
        name
        for name, row in KINDS.items()
        if type(job).__module__.startswith(row.module.rsplit(".", 1)[0]) and name in type(job).__name__.lower()
    )


class Opened(SimpleNamespace):
    """What the arguments of the commands are read with."""


@pytest.fixture
def opened() -> Any:
    rig = SimpleNamespace(names=("two words, and a comma", "-x", "cam"))
    return Opened(capture=SimpleNamespace(rig=rig, n_frames=20), clips=[], trained=[])


@pytest.mark.parametrize("job", JOBS, ids=lambda job: f"{type(job).__name__}-{JOBS.index(job)}")
def test_an_export_as_a_command_line(job, opened, monkeypatch):
    kind = kind_of(job)
    command = as_command(Path("/somewhere/-p"), kind, job)
    arguments = shlex.split(command.shell(is_windows=False))[1:]
    options = build_parser(arguments[:1]).parse_args(arguments)
    assert options.project == Path("/somewhere/-p")
    assert _job_of(options, opened, monkeypatch) == job


def _job_of(options: argparse.Namespace, opened: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The job that the command hands over to whoever carries it out."""
    if options.command == "render":
        return render_command._job(options, opened)
    made: list[Any] = []

    class Work:
        def estimate(self, opened: Any, job: Any) -> Any:
            return SimpleNamespace(lines=())

        def run(self, opened: Any, job: Any, report: Any) -> None:
            made.append(job)

    monkeypatch.setattr("app.export.export_jobs.ExportKind.load", lambda row: Work())
    kind = next((kind for kind in export_command.KINDS if options.format in kind.FORMATS), export_command.export_player)
    export_command._check_options(options, kind)
    kind.export(opened, options, export_command._frames(options, opened), lambda progress: None)
    return made[0]


@pytest.mark.parametrize("job", JOBS, ids=lambda job: f"{type(job).__name__}-{JOBS.index(job)}")
def test_an_export_as_python(job, tmp_path, monkeypatch):
    from tests.app.made_projects import make_project

    make_project(tmp_path / "it's mine").close()
    made: list[Any] = []
    monkeypatch.setattr(
        scripted_project,
        "run_named_job",
        lambda opened, report, name, out, **options: made.append(named_job(name, out, **options)),
    )
    monkeypatch.setattr(scripted_project.ScriptedProject, "open_trained", lambda project: None)
    command = as_command(tmp_path / "it's mine", kind_of(job), job)
    exec(compile(command.python, "pasted", "exec"), {"__name__": "__main__"})
    assert made == [(kind_of(job), job)]


def test_a_training():
    settings = ProjectSettings(capture="/captures/my capture", fingerprint="x", follow_links=True)
    own = {"source_steps": 300, "ssim_weight": 0.25}
    command = training_command(Path("/p"), settings, 3, is_again=True, own=own)
    arguments = shlex.split(command.shell(is_windows=False))[1:]
    options = build_parser(["train"]).parse_args(arguments)
    assert (options.capture, options.project) == (Path("/captures/my capture"), Path("/p"))
    assert (options.clips, options.again, options.follow_links) == ("3:4", True, True)
    assert parse_overrides(options.own_assignments) == own
    assert command.statement == f"project.train_clip(3, is_again=True, settings={own!r})"
    assert train_command is not None


def test_a_mending():
    for command, expected, statement in (
        (mend_command(Path("/p"), after=2), MendRequest(after=2), "project.mend(boundary=2)"),
        (
            mend_command(Path("/p"), frames=(3, 9), method="fade"),
            MendRequest(frames=(3, 9), method="fade"),
            "project.mend(frames=range(3, 9), method='fade')",
        ),
    ):
        options = build_parser(["mend"]).parse_args(shlex.split(command.shell(is_windows=False))[1:])
        assert (options.project, options.method) == (Path("/p"), expected.method)
        assert (options.boundary, options.frames) == (
            None if expected.after is None else f"{expected.after - 1}:{expected.after}",
            None if expected.frames is None else "{}:{}".format(*expected.frames),
        )
        assert command.statement == statement


def test_a_version():
    command = version_command(Path("/p"), 3, 12)
    options = build_parser(["versions"]).parse_args(shlex.split(command.shell(is_windows=False))[1:])
    assert (options.project, options.clip, options.restore) == (Path("/p"), 3, 12)
    assert command.statement == "project.restore_version(3, 12)"


def test_the_table_of_names_is_complete():
    gaussians = [name for name, row in JOB_FORMATS.items() if row.kind == "gaussians"]
    assert gaussians == list(GAUSSIAN_FORMATS)
    assert [name for name, row in JOB_FORMATS.items() if row.kind == "video"] == list(VIDEO_FORMATS)
    assert {row.kind for row in JOB_FORMATS.values()} == set(KINDS)
    on_command_line = {name for kind in export_command.KINDS for name in kind.FORMATS}
    assert on_command_line | {"player"} | set(VIDEO_FORMATS) == set(JOB_FORMATS)
    for name, row in JOB_FORMATS.items():
        kind, job = named_job(name, "x")
        assert (kind, format_name_of(kind, job)) == (row.kind, name)


def test_names_and_options_that_are_not_known():
    with pytest.raises(ProjectError, match=r"no format 'obj'. Formats are ply, "):
        named_job("obj", "x")
    with pytest.raises(ProjectError, match=r"no option 'colour' of spz. Options are frames, part"):
        named_job("spz", "x", colour="red")
    with pytest.raises(ProjectError, match="no option 'format' of ply"):
        named_job("ply", "x", format="spz")
