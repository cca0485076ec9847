"""clipgstream schedule: what its jobs ask for, which clips they have, and what it refuses."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

import pytest

from app.cli import schedule_command
from app.project.opening.project_access import open_project
from app.schedule.clip_jobs import ClipJobs
from app.schedule.job_files import SCHEDULERS, job_text
from engine.errors import ProjectError


def schedule(run, capture_folder: Path, project: Path, scheduler: str, *options: str) -> tuple[int, str, str]:
    """Schedule the tiny capture in clips of one frame: six of them."""
    return run("schedule", capture_folder, "--project", project, "--for", scheduler, "--clip-length", "1", *options)


@pytest.mark.parametrize("scheduler", SCHEDULERS)
def test_a_project_is_made_and_its_job_written(run, capture_folder, tmp_path, scheduler):
    code, out, said = schedule(run, capture_folder, tmp_path / "p q", scheduler, "--set", "static_steps=7")
    assert code == 0, said
    path = tmp_path / "p q" / SCHEDULERS[scheduler].file
    assert out == f"{' '.join(SCHEDULERS[scheduler].submit)} {shlex.quote(str(path))}\n"
    text = path.read_text()
    assert str(capture_folder) in text
    assert not re.search(r"@\w*@|@:|:@", text)
    settings = open_project(tmp_path / "p q", is_writable=False).settings
    assert (settings.clip_length, settings.overrides) == (1, {"static_steps": 7})
    assert "clip 0, then 5 others" in said


def test_trained_clips_have_no_task(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert schedule(run, capture_folder, project, "slurm", "--clips", "2:4")[0] == 0
    assert "--array=2-3 " in (project / "train.sbatch").read_text()
    assert run("train", capture_folder, "--project", project, "--clips", "0:4", "--quiet")[0] == 0
    assert schedule(run, capture_folder, project, "slurm", "--replace")[0] == 0
    assert "--array=4-5 " in (project / "train.sbatch").read_text()
    assert run("train", capture_folder, "--project", project, "--quiet")[0] == 0
    code, out, said = schedule(run, capture_folder, project, "shell")
    assert (code, out) == (0, "")
    assert "Nothing to schedule" in said
    assert not (project / "train.sh").exists()


def test_the_time_is_a_stated_guess_where_no_forecast_is_possible(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(schedule_command, "step_time", lambda *_: None)
    code, _, said = schedule(run, capture_folder, tmp_path / "p", "slurm")
    assert code == 0
    assert "24 h 00 min for each clip, since no forecast" in said
    assert "--time=1440 " in (tmp_path / "p" / "train.sbatch").read_text()


def test_a_project_that_a_window_has_open_can_be_scheduled_with_its_settings(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert schedule(run, capture_folder, project, "slurm")[0] == 0
    opened = open_project(project)
    assert schedule(run, capture_folder, project, "shell")[0] == 0
    code, _, said = schedule(run, capture_folder, project, "openjd", "--seed", "3")
    assert code == 2
    assert "open" in said
    opened.close()


def test_what_cannot_be_scheduled_is_refused(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    code, _, said = schedule(run, capture_folder, project, "pbs")
    assert code == 2
    assert "slurm" in said
    assert not project.exists()
    assert schedule(run, capture_folder, project, "shell", "--clips", "5:9")[0] == 2
    assert schedule(run, capture_folder, project, "shell", "--set", "nothing=1")[0] == 2
    assert schedule(run, capture_folder, project, "shell")[0] == 0
    before = (project / "train.sh").read_text()
    code, _, said = schedule(run, capture_folder, project, "shell", "--clips", "1:2")
    assert code == 2
    assert "--replace" in said
    assert (project / "train.sh").read_text() == before
    code, _, said = schedule(run, capture_folder, project, "shell", "--out", str(tmp_path / "no" / "no" / "job.sh"))
    assert code == 1
    assert "could not be written" in said
    code, _, said = schedule(run, capture_folder, tmp_path / "chain", "slurm", "--set", "field=continue")
    assert code == 2
    assert "each of the 6 clips follows the one before" in said
    assert not (tmp_path / "chain").exists()


def jobs(sources: tuple[int, ...]) -> ClipJobs:
    """Jobs for these clips, after clip 0."""
    return ClipJobs(0, sources, n_cpus=2, memory_mb=512, reference_s=600, source_s=600, is_time_known=True, skipped=())


def text_of(scheduler: str, sources: tuple[int, ...]) -> str:
    """A job for these clips."""
    return job_text(SCHEDULERS[scheduler], jobs(sources), capture=Path("/c"), project=Path("/p"), python="python")


def test_clips_that_are_left_are_written_as_runs():
    sources = (1, 2, 3, 7, 9, 10)
    assert "--array=1-3,7,9-10 " in text_of("slurm", sources)
    assert 'range: "1-3,7,9-10"' in text_of("openjd", sources)
    assert "train $(seq 1 3) 7 $(seq 9 10)\n" in text_of("shell", sources)


def test_more_clips_than_an_array_holds_are_several_a_task():
    text = text_of("slurm", (5, *range(2000, 10_000)))
    assert "--array=0-999 " in text
    assert 'seq "$SLURM_ARRAY_TASK_ID" 1000 9999' in text
    assert "--time=100 " in text  # ten clips of ten minutes


def test_a_single_clip_needs_no_array():
    assert "array" not in text_of("slurm", ()).partition("\nfi\n")[0]
    assert "Sources" not in text_of("openjd", ())


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
def test_a_name_that_is_no_text_is_refused():
    with pytest.raises(ProjectError, match="not valid UTF-8"):
        job_text(SCHEDULERS["shell"], jobs(()), capture=Path("/c\udc80"), project=Path("/p"))
