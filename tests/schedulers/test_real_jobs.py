"""The jobs with nothing faked: the sample, made small, trained by SLURM, by `openjd run` and by two shells."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.cli import main
from app.project.opening.project_access import open_project
from engine.assets import asset_path
from tests.schedulers.slurm_here import slurm_here, why_no_slurm
from tests.schedulers.test_openjd import needs_openjd

SETTINGS = (
    "max_static_points=1500",
    "max_moving_points=800",
    "background_frames=6",
    "static_steps=12",
    "joint_steps=8",
    "source_steps=8",
)
DEADLINE_S = 900.0

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")]


@pytest.fixture(autouse=True)
def this_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run this tree, wherever the environment's own package is."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))


def made(folder: Path, scheduler: str, capsys: pytest.CaptureFixture[str]) -> tuple[Path, list[str]]:
    """A project of which two clips are wanted, and the command that its job is submitted with."""
    project = folder / "a project"
    arguments = ["schedule", str(asset_path("sample")), "--project", str(project), "--for", scheduler]
    for assignment in SETTINGS:
        arguments += ["--set", assignment]
    assert main([*arguments, "--clips", "0:2", "--scale", "0.25"]) == 0
    job = next(path for path in project.rglob("t*") if path.suffix in (".sbatch", ".sh", ".yaml"))
    command = capsys.readouterr().out.strip()
    assert command.endswith(f"'{job}'")
    return project, [*command.removesuffix(f"'{job}'").split(), str(job)]


def trained(folder: Path) -> list[int]:
    """The clips of a project that are finished and can be read."""
    project = open_project(folder, is_writable=False)
    return [index for index, _ in project.finished_clips() if project.is_trained(index)]


def training_of(project: Path, clip: int) -> int | None:
    """The process that trains a clip by `clipgstream train --clip`; None where there is none."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:  # it has ended
            continue
        if b"ui" in words and str(project).encode() in words and words[-3:-1] == [b"--clip", str(clip).encode()]:
            return int(path.parent.name)
    return None


@pytest.mark.skipif(bool(why_no_slurm()), reason=why_no_slurm())
def test_slurm_trains_the_sample_though_a_job_is_killed(tmp_path, capsys):
    project, command = made(tmp_path, "slurm", capsys)
    (tmp_path / "slurm").mkdir()
    with slurm_here(tmp_path / "slurm") as cluster:
        cluster.call(*command)
        begun = project / "logs" / "clip-0001.log"
        cluster.wait(begun.exists, deadline_s=DEADLINE_S)
        killed = training_of(project, 1)
        assert killed is not None
        os.kill(killed, signal.SIGKILL)
        cluster.wait_for(("COMPLETED", "FAILED", "CANCELLED"), deadline_s=DEADLINE_S)
        assert cluster.states() == {"1": "COMPLETED", "2_1": "COMPLETED"}
        assert [job["Restarts"] for job in cluster.jobs()] == ["0", "1"]
    assert trained(project) == [0, 1]


@needs_openjd
def test_openjd_trains_the_sample(tmp_path, capsys):
    project, command = made(tmp_path, "openjd", capsys)
    program = [sys.executable, "-P", "-m", *command]
    subprocess.run(program, check=True, timeout=DEADLINE_S, stdout=subprocess.DEVNULL)
    assert trained(project) == [0, 1]


def test_two_shells_train_the_sample(tmp_path, capsys):
    project, command = made(tmp_path, "shell", capsys)
    job = Path(command[-1])
    job.write_text(job.read_text().replace("sleep 30", "sleep 1"))
    shells = [subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL) for _ in range(2)]
    assert [shell.wait(DEADLINE_S) for shell in shells] == [0, 0]
    assert trained(project) == [0, 1]
