"""Jobs as commands: the command line makes the same job of them, and so does a script."""

from __future__ import annotations

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
from app.export.jobs.cameras import CamerasJob
from app.export.jobs.gaussians import GaussiansJob
from app.export.jobs.metrics import MetricsJob
from app.export.jobs.player import PlayerJob
from app.export.jobs.table import KINDS, formats_of, named_job
from app.export.jobs.video import Turntable, VideoJob
from app.export.picked_frames import PickedFrames
from app.export.video.formats import FORMATS as VIDEO_FORMATS
from app.mending.request import MendRequest
from app.scripting import scripted_project
from engine.errors import ProjectError
from engine.export.formats.table import FORMATS as GAUSSIAN_FORMATS
from engine.training.config import parse_overrides

GAPS = PickedFrames((range(0, 4, 2), range(10, 20, 2)), 2)
OUT = Path("/somewhere/it's 100 % out")
JOBS = [
    GaussiansJob(OUT),
    GaussiansJob(OUT, "spz", PickedFrames.of(range(3, 4)), axes="rub"),
    GaussiansJob(OUT, fields="full"),
    GaussiansJob(OUT, "sog", PickedFrames.of(range(0, 20, 3)), "split", "-y", 1e-5),
    GaussiansJob(OUT, "glb", GAPS, "moving", "+z", 100.0, scene_up=(0.0, -1.0, 1e-6)),
    PlayerJob(OUT.with_suffix(".html")),
    PlayerJob(OUT.with_suffix(".html"), PickedFrames.of(range(0, 20, 2)), True),
    PlayerJob(OUT.with_suffix(".html"), GAPS, False),
    PlayerJob(OUT.with_suffix(".html"), has_edits=False),
    GaussiansJob(OUT, has_edits=False),
    VideoJob(OUT, "png", camera="cam", has_edits=False),
    MetricsJob(OUT.with_suffix(".json"), "json", PickedFrames.of(range(20))),
    MetricsJob(OUT.with_suffix(".csv")),
    CamerasJob(OUT),
    CamerasJob(OUT, "transforms"),
    VideoJob(OUT.with_suffix(".mp4"), "mp4", camera="two words, and a comma"),
    VideoJob(OUT, "png", camera="-x", is_transparent=True, size=(64, 48), supersampling=2, features="static"),
    VideoJob(
        OUT.with_suffix(".webm"),
        "webm",
        path='it\'s "mine"',
        frames=PickedFrames.of(range(3, 9)),
        speed=0.25,
        fps=24.0,
        sound="-x",
    ),
    VideoJob(OUT.with_suffix(".mp4"), "mp4", turntable=Turntable(-1.0, 1e-5, 2.5), hold=3.0, background=(1, 2, 255)),
    VideoJob(OUT, "exr", turntable=Turntable(), shows="depth"),
]


class Opened(SimpleNamespace):
    """What the arguments of the commands are read with."""


@pytest.fixture
def opened() -> Any:
    rig = SimpleNamespace(names=("two words, and a comma", "-x", "cam"))
    return Opened(capture=SimpleNamespace(rig=rig, n_frames=20), clips=[], trained=[])


@pytest.mark.parametrize("job", JOBS, ids=lambda job: f"{type(job).__name__}-{JOBS.index(job)}")
def test_an_export_as_a_command_line(job, opened):
    command = as_command(Path("/somewhere/-p"), job)
    arguments = shlex.split(command.shell(is_windows=False))[1:]
    options = build_parser(arguments[:1]).parse_args(arguments)
    assert options.project == Path("/somewhere/-p")
    if options.command == "export":
        export_command.check_options(options)
    assert (render_command if options.command == "render" else export_command).job_of(options, opened) == job


@pytest.mark.parametrize("job", JOBS, ids=lambda job: f"{type(job).__name__}-{JOBS.index(job)}")
def test_an_export_as_python(job, tmp_path, monkeypatch):
    from tests.app.made_projects import make_project

    make_project(tmp_path / "it's mine").close()
    made: list[Any] = []

    class Work:
        def run(self, opened: Any, job: Any, report: Any) -> None:
            made.append(job)

    monkeypatch.setattr("app.export.jobs.job.ExportJob.load", lambda job: Work())
    monkeypatch.setattr(scripted_project.ScriptedProject, "open_trained", lambda project: None)
    command = as_command(tmp_path / "it's mine", job)
    exec(compile(command.python, "pasted", "exec"), {"__name__": "__main__"})
    assert made == [job]


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


def test_every_format_has_a_name_and_a_job():
    assert list(KINDS["gaussians"].formats()) == list(GAUSSIAN_FORMATS)
    assert list(formats_of("render")) == list(VIDEO_FORMATS)
    for name, job in formats_of().items():
        made = named_job(name, "x")
        assert (type(made), made.format_name) == (job, name)


def test_names_and_options_that_are_not_known():
    with pytest.raises(ProjectError, match=r"no format 'obj'. Formats are ply, "):
        named_job("obj", "x")
    with pytest.raises(ProjectError, match=r"no option 'colour' of spz. Options are frames, part"):
        named_job("spz", "x", colour="red")
    with pytest.raises(ProjectError, match="no option 'format' of ply"):
        named_job("ply", "x", format="spz")
