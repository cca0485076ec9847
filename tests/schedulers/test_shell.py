"""The script for a shell, run on two computers that share a folder: two processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.schedulers.stand_in import calls, scheduled, times_trained

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="a script for POSIX shells"),
]
DEADLINE_S = 600.0
"""Only a hang takes longer: each attempt is a process."""


def impatient(folder: Path, *, n_clips: int) -> tuple[Path, Path]:
    """A project and its script, which waits for a tenth of a second instead of half a minute."""
    project, job = scheduled("shell", folder, n_clips=n_clips)
    job.write_text(job.read_text().replace("sleep 30", "sleep 0.1"))
    return project, job


def started(job: Path, **environment: str) -> subprocess.Popen[bytes]:
    """The script, begun."""
    return subprocess.Popen(
        ["sh", job], env=os.environ | environment, stderr=subprocess.DEVNULL, start_new_session=True
    )


def until(is_so: Callable[[], bool]) -> None:
    until_s = time.monotonic() + DEADLINE_S
    while not is_so():
        assert time.monotonic() < until_s
        time.sleep(0.05)


def test_two_computers_share_the_clips(tmp_path):
    project, job = impatient(tmp_path, n_clips=12)
    (project / "hold-0").touch()  # until the second computer has had to wait
    (project / "fail-5").write_text("1")
    (project / "fail-7").write_text("75 75")
    first, second = started(job), started(job, JOBS="2")
    until(lambda: 75 in calls(project, 0))
    (project / "hold-0").unlink()
    assert second.wait(DEADLINE_S) == 0
    assert times_trained(project, 12) == [1] * 12  # none leaves before all is done
    assert first.wait(DEADLINE_S) == 0
    assert times_trained(project, 12) == [1] * 12
    assert 1 in calls(project, 5)
    assert started(job).wait(DEADLINE_S) == 0
    assert times_trained(project, 12) == [1] * 12


def test_a_clip_that_keeps_failing_holds_up_no_other(tmp_path):
    project, job = impatient(tmp_path, n_clips=4)
    (project / "fail-1").write_text("1 1 1 1")
    assert started(job).wait(DEADLINE_S) != 0
    assert times_trained(project, 4) == [1, 0, 1, 1]
    assert calls(project, 1) == [1, 1, 1]


def test_bad_input_ends_it_at_once(tmp_path):
    project, job = impatient(tmp_path, n_clips=3)
    (project / "fail-0").write_text("2")
    assert started(job).wait(DEADLINE_S) != 0
    assert (project / "calls").read_text() == "0 2\n"


def test_ctrl_c_ends_all(tmp_path):
    project, job = impatient(tmp_path, n_clips=3)
    for clip in (1, 2):
        (project / f"slow-{clip}").write_text("1000")
    computer = started(job, JOBS="2")
    until(lambda: all((project / f"begun-{clip}").exists() for clip in (1, 2)))
    os.killpg(computer.pid, signal.SIGINT)
    assert computer.wait(DEADLINE_S) != 0
    for clip in (1, 2):
        until(lambda clip=clip: 130 in calls(project, clip))
