"""The job for Open Job Description, run by `openjd run`."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.schedulers.stand_in import calls, scheduled, times_trained

needs_openjd = pytest.mark.skipif(
    importlib.util.find_spec("openjd") is None or importlib.util.find_spec("openjd.cli") is None,
    reason="openjd-cli is not installed",
)
pytestmark = [
    pytest.mark.slow,
    needs_openjd,
    pytest.mark.skipif(sys.platform == "win32", reason="the stand-in is a script for POSIX"),
]
OPENJD = [sys.executable, "-P", "-m", "openjd"]
DEADLINE_S = 600.0


def openjd(command: str, job: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a command of openjd to its end."""
    return subprocess.run(
        [*OPENJD, command, job, *options], capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )


def test_the_reference_clip_is_trained_and_then_the_others(tmp_path):
    project, job = scheduled("openjd", tmp_path, n_clips=5, reference=2)
    (project / "done-0").touch()  # what the stand-in takes for the reference clip
    done = openjd("run", job)
    assert done.returncode == 0, done.stdout + done.stderr
    assert times_trained(project, 5) == [0, 1, 1, 1, 1]
    assert (project / "calls").read_text().split("\n")[0] == "2 0"


def test_a_failure_ends_the_run_and_the_next_one_resumes(tmp_path):
    project, job = scheduled("openjd", tmp_path, n_clips=3)
    (project / "fail-1").write_text("1")
    assert openjd("run", job).returncode != 0
    assert openjd("run", job).returncode == 0
    assert times_trained(project, 3) == [1, 1, 1]
    assert calls(project, 1) == [1, 0]


def test_an_interrupted_run_interrupts_the_training(tmp_path):
    project, job = scheduled("openjd", tmp_path, n_clips=1)
    (project / "slow-0").write_text("1000")
    run = subprocess.Popen([*OPENJD, "run", job], stdout=subprocess.DEVNULL, start_new_session=True)
    until_s = time.monotonic() + DEADLINE_S
    while not (project / "begun-0").exists():
        assert time.monotonic() < until_s
        time.sleep(0.05)
    os.kill(run.pid, signal.SIGINT)
    assert run.wait(DEADLINE_S) != 0
    assert calls(project, 0) == [130]


def test_ten_thousand_clips_are_one_step(tmp_path):
    _, job = scheduled("openjd", tmp_path, n_clips=10_000)
    found = json.loads(openjd("summary", job, "--output", "json").stdout)
    assert found["total_tasks"] == 10_000
    assert found["steps"][1]["dependencies"] == [{"step_name": "Reference"}]
