"""How many clips train side by side, and how long a sequence takes."""

from __future__ import annotations

import json
import re

import pytest

from app.cli.cli import main
from app.plan import side_by_side as module
from app.plan.side_by_side import PlannedClips, SideBySide, plan_here, side_by_side
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.training.process import ProcessWorker
from engine.errors import ProjectError
from engine.training.plan.plan import TrainingPlan
from tests.app.fakes import write_trained
from tests.app.training.test_train_queue import six

__all__ = ["six"]

ROOMY = {"n_ready": 100, "is_chain": False, "n_cores": 8, "clip_mb": 2400.0, "free_mb": 1e6}


def chosen(n_wanted: int, **known) -> SideBySide:
    return side_by_side(n_wanted, **(ROOMY | known))


def test_as_many_as_asked_for_where_there_is_room() -> None:
    assert chosen(8) == SideBySide(8)
    assert chosen(8, free_mb=None) == SideBySide(8), "a system that does not say how much is free"
    assert chosen(3, free_mb=7200.0) == SideBySide(3)


def test_never_more_than_cores_with_a_word_about_it() -> None:
    assert chosen(4, n_cores=2) == SideBySide(
        2,
        "2 instead of 4 clips train side by side: on 2 cores, more would only take turns and need more memory.",
    )
    assert chosen(4, n_cores=1).n_workers == 1
    assert "1 core, more" in chosen(2, n_cores=1).why_fewer
    assert chosen(4, n_cores=2, free_mb=4800.0).n_workers == 2, "memory of those that run, not of those asked for"


def test_no_more_than_clips_without_a_word() -> None:
    assert chosen(4, n_ready=2, n_cores=2) == SideBySide(2)
    assert chosen(4, n_ready=1, clip_mb=1e9) == SideBySide(1), "one may always try"


def test_a_chain_trains_one_after_another() -> None:
    assert chosen(3, is_chain=True).n_workers == 1
    assert "continues from the one before" in chosen(3, is_chain=True).why_fewer
    assert chosen(1, is_chain=True) == SideBySide(1)


@pytest.mark.parametrize(("free_mb", "n_fitting"), [(5100.0, 2), (7199.0, 2), (2500.0, 1), (100.0, 1)])
def test_too_little_memory_is_refused_with_numbers(free_mb: float, n_fitting: int) -> None:
    with pytest.raises(ProjectError) as refused:
        chosen(3, free_mb=free_mb)
    said = str(refused.value)
    assert "3 clips side by side need about 7.2 GB of memory, 2.4 GB each; " in said
    assert f"{free_mb / 1e3:.1f} GB are free" in said
    assert f"Use --workers {n_fitting}," in said


def test_the_reference_clip_comes_alone_and_does_not_count(six: OpenedProject, monkeypatch) -> None:
    monkeypatch.setattr(module, "n_cores", lambda: 8)
    monkeypatch.setattr(module, "free_memory_bytes", lambda: 10**12)
    catalog = ClipCatalog(six.project, 6)
    plan = plan_here(six.project, six.capture, six.clips[:4], catalog, 8)
    assert plan.together == SideBySide(3)
    assert plan.expected_s(six.project, six.clips[0]) is None, "nothing is timed for it"
    assert plan_here(six.project, six.capture, [six.clips[0]], catalog, 8).together == SideBySide(1)
    assert plan_here(six.project, six.capture, [], catalog, 8).together == SideBySide(1)
    write_trained(six, 0)
    assert plan_here(six.project, six.capture, six.clips[1:4], catalog, 2).together == SideBySide(2)


def test_clips_take_longer_next_to_others_but_the_reference_clip_comes_alone(six: OpenedProject) -> None:
    plan = TrainingPlan(1, 0, 1, "source", 100, (), 5.0, 40.0, 1.0, 2.0)
    planned = PlannedClips(SideBySide(4), {(False, 1): plan, (True, 1): plan}, times_longer=2.0)
    assert [planned.expected_s(six.project, clip) for clip in six.clips[:2]] == [45.0, 90.0]


def test_the_command_refuses_what_memory_cannot_hold_and_leaves_nothing(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "n_cores", lambda: 2)
    monkeypatch.setattr(module, "free_memory_bytes", lambda: 10**9)
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 2)
    code, out, err = run(*arguments, "--workers", 2)
    assert (code, out) == (2, "")
    assert "2 clips side by side need about 1.3 GB of memory, 0.7 GB each; 1.0 GB are free. Use --workers 1" in err
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "two", ""])
def test_a_number_of_workers_is_one_or_more(run, capture_folder, tmp_path, text):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", f"--workers={text}")
    assert code == 2
    assert "is not a number of clips, 1 or more" in err


@pytest.mark.parametrize("n_workers", [1, 2])
def test_the_command_names_clips_that_were_not_begun(run, capture_folder, tmp_path, monkeypatch, n_workers):
    monkeypatch.setattr(module, "n_cores", lambda: 2)
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 1, "--json")
    code, out, err = run(*arguments, "--set", "static_steps=4", "--workers", n_workers)
    assert code == 1
    assert [clip["state"] for clip in json.loads(out)["clips"]] == ["failed", *["left_out"] * 5]
    assert "nan at step 5" in err
    assert err.rstrip().endswith("\nNot begun, because clip 0 is not finished: clip 1 to 5.")


def test_the_command_shows_all_of_them_and_plans_none_by_its_pictures(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "n_cores", lambda: 2)
    monkeypatch.setattr("app.cli.terminal.training_lines.plan_clip", None)  # it decodes pictures of every clip
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 1, "--clips", "0:3")
    code, _, err = run(*arguments, "--workers", 2)
    assert code == 0, err
    assert re.search(r"^All +\d+ %  \d/3 clips", err, re.MULTILINE)
    assert not re.search(r"^Clip \d: \d+ steps", err, re.MULTILINE)


@pytest.mark.slow
def test_the_command_trains_them_in_processes_and_goes_on_after_a_failure(
    run, capture_folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(module, "n_cores", lambda: 2)
    arguments = ["train", str(capture_folder), "--project", str(tmp_path / "p"), "--clip-length", "1"]
    arguments += ["--clips", "0:4", "--workers", "3", "--json"]

    def launch(job, project):
        make = "make_crashing" if job.clip_index == 1 else "make_fake"
        return ProcessWorker(job, project, f"tests.app.fakes:{make}")

    assert main(arguments, launch=launch) == 1
    out, err = capsys.readouterr()
    states = {clip["clip_index"]: clip["state"] for clip in json.loads(out)["clips"]}
    assert states == {0: "trained", 1: "failed", 2: "trained", 3: "trained"}
    assert "2 instead of 3 clips train side by side" in err
    assert err.count("Clip 1 failed: The training process was ended by signal 9") == 1
    assert "clip-0001.log" in err.splitlines()[-1]
    code, out, _ = run(*arguments)
    assert code == 0
    assert sorted(clip["state"] for clip in json.loads(out)["clips"]) == ["skipped"] * 3 + ["trained"]
