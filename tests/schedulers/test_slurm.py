"""The job for SLURM, given to a cluster of this one machine."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.schedulers.slurm_here import SlurmHere, slurm_here, why_no_slurm
from tests.schedulers.stand_in import calls, scheduled, times_trained

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(why_no_slurm()), reason=why_no_slurm())]

DONE = ("COMPLETED", "FAILED", "CANCELLED")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[SlurmHere]:
    """A cluster with two cores."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    with slurm_here(folder) as started:
        yield started


def test_failed_jobs_are_tried_again_and_bad_input_is_not(cluster, tmp_path):
    project, job = scheduled("slurm", tmp_path, n_clips=5)
    (project / "fail-0").write_text("1 75")
    (project / "fail-2").write_text("2")
    (project / "fail-3").write_text("1 1 1 1 1 1 1")
    said = cluster.call("bash", job)
    assert "Job 1 trains the reference clip" in said
    cluster.wait_for(DONE)
    assert times_trained(project, 5) == [1, 1, 0, 0, 1]
    assert [calls(project, clip) for clip in range(5)] == [[1, 75, 0], [0], [2], [1, 1, 1, 1], [0]]
    assert (project / "calls").read_text().startswith("0 1\n0 75\n0 0\n")
    assert sorted(cluster.states().values()) == ["COMPLETED", "COMPLETED", "COMPLETED", "FAILED", "FAILED"]
    cluster.call("bash", job)  # again: what was done is done
    (project / "fail-3").unlink()
    cluster.wait_for(DONE)
    assert times_trained(project, 5) == [1, 1, 1, 1, 1]


def test_a_job_that_is_killed_or_out_of_time_is_finished_and_a_cancelled_one_is_not(cluster, tmp_path):
    project, job = scheduled("slurm", tmp_path, n_clips=4)
    for clip in (1, 2, 3):
        (project / f"slow-{clip}").write_text("1000")
    cluster.call("bash", job)
    cluster.wait(lambda: all((project / f"begun-{clip}").exists() for clip in (1, 2)))
    for clip in (1, 2):
        (project / f"slow-{clip}").write_text("0")
    (project / "claim-1").unlink()  # as one that nobody keeps any longer
    os.kill(int((project / "begun-1").read_text()), signal.SIGKILL)
    cluster.call("scancel", "--batch", "--signal=USR1", "2_2")  # what SLURM sends before the time limit
    cluster.wait(lambda: (project / "begun-3").exists())
    cluster.call("scancel", "2_3")
    cluster.wait_for(DONE)
    assert times_trained(project, 4) == [1, 1, 1, 0]
    assert [calls(project, clip) for clip in (1, 2, 3)] == [[0], [130, 0], [130]]
    assert cluster.states()["2_3"] == "CANCELLED"


def test_nothing_runs_where_the_reference_clip_cannot_be_trained(cluster, tmp_path):
    project, job = scheduled("slurm", tmp_path, n_clips=3)
    (project / "fail-0").write_text("2")
    cluster.call("bash", job)
    cluster.wait_for(DONE)
    assert (project / "calls").read_text() == "0 2\n"


def test_ten_thousand_clips_are_one_array(cluster, tmp_path):
    project, job = scheduled("slurm", tmp_path, n_clips=10_000)
    (project / "done-0").write_text("x")
    cluster.call("bash", job)
    cluster.wait(lambda: (project / "done-9000").exists())
    cluster.call("scancel", "--user=root")
    cluster.wait_for(DONE)
    assert calls(project, 9000) == [0]
