"""A disk that refuses, and a project folder that goes away: what was learned is kept, the training goes on or says why.

The loop with a small training and a clock of its own; `tests.faults` does the same to real processes on a full disk.
"""

from __future__ import annotations

import errno
import os
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from msgspec.structs import replace

from app.training import messages as m
from app.training.messages import Pause, SnapshotConsumed, Stop
from app.training.worker import disk_retries
from engine.clip_files.clip_state import read_clip_state
from engine.errors import CaptureError
from tests.app.fakes import make_fake
from tests.app.test_run import Bench


@pytest.fixture
def bench(tmp_path, capture_folder):
    def make(**options) -> Bench:
        return Bench(tmp_path / "p", capture_folder, **options)

    return make


HANDED_OVER = "0000-trained.safetensors"


class Disk:
    """Refuses to put files of some names or folders in their place, for as long as it is full."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *names: str, number: int = errno.ENOSPC) -> None:
        self.is_full, self.n_refused = True, 0
        replace = os.replace

        def refuse(source, target):
            if self.is_full and {Path(target).name, Path(target).parent.name}.intersection(names):
                self.n_refused += 1
                raise OSError(number, os.strerror(number), str(target))
            replace(source, target)

        monkeypatch.setattr("os.replace", refuse)


def without_window(it: Bench) -> Bench:
    """A training of the command line."""
    it.job = replace(it.job, is_window_open=False)
    it.start()
    return it


def finished(it: Bench) -> dict:
    """Arrays of the clip that was handed over."""
    return read_clip_state(it.handed_over).arrays


def test_live_snapshots_come_back_when_there_is_room_again(bench, monkeypatch):
    it = bench()
    disk = Disk(monkeypatch, "live")
    it.steps(20)
    assert disk.n_refused > 3
    assert len(it.of(m.WarningRaised)) == 1  # said once, and not every two seconds
    disk.is_full = False
    it.steps(5)
    assert [event.revision for event in it.of(m.SnapshotWritten)] == [1]
    it.commands.append(SnapshotConsumed(1))
    disk.is_full = True
    it.steps(5)
    assert len(it.of(m.WarningRaised)) == 2  # full again is news


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to(path.parents[2] / "letter")])
def test_curves_that_are_something_else_are_left_alone_and_said_once(bench, make, tmp_path):
    (tmp_path / "letter").write_text("x")
    it = bench(n_steps=5)
    it.steps(1)
    path = it.project.unfinished_metrics_path(0)
    path.unlink(missing_ok=True)
    path.parent.mkdir(exist_ok=True)
    make(path)
    it.steps(4)
    (told,) = it.of(m.WarningRaised)
    assert told.title == "The curves could not be written"
    assert (tmp_path / "letter").read_text() == "x"


def test_a_checkpoint_is_due_by_the_clock_however_slowly_it_is_written(bench, monkeypatch):
    it = bench(n_steps=1000)
    it.steps(1)
    kept_s = []
    write = it.training.write_checkpoint

    def slowly(path):
        kept_s.append(it.now_s)
        write(path)
        it.now_s += 4.0

    it.training.write_checkpoint = slowly
    it.steps(200)
    gaps = [later - earlier for earlier, later in pairwise(kept_s)]
    assert kept_s[0] <= 30.0
    assert len(gaps) >= 5
    # a kill just before one is complete costs the time since the start of the one before, and the writing
    assert max(gaps) + 4.0 <= 30.0


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EROFS, errno.ESTALE])
def test_a_clip_that_cannot_be_handed_over_is_a_checkpoint_until_it_can(bench, monkeypatch, number):
    it = bench(n_steps=5)
    disk = Disk(monkeypatch, HANDED_OVER, number=number)
    assert it.steps(8) is True
    assert not it.handed_over.exists()
    assert read_clip_state(it.checkpoint).header.step == 5
    (told,) = it.of(m.WarningRaised)
    assert "trained, but could not be written" in told.title
    assert os.strerror(number) in told.detail
    assert "saved as a checkpoint" in told.detail
    disk.is_full = False
    assert it.steps(20) is False
    assert isinstance(it.events[-1], m.ClipTrained)
    assert read_clip_state(it.handed_over).header.step == 5


def test_a_disk_full_of_finished_preparation_takes_the_clip_once_that_is_gone(bench, monkeypatch):
    it = without_window(bench(n_steps=5))
    it.steps(2)
    prep = it.project.prep_dir
    prep.mkdir(exist_ok=True)
    for name in ("clip-0000-0", "clip-0000-1", "clip-0001-0", "backgrounds"):
        (prep / f"{name}.safetensors").write_text("x")
    disk = Disk(monkeypatch, HANDED_OVER, "checkpoints")
    monkeypatch.setattr("os.replace", full_while(lambda: (prep / "clip-0000-1.safetensors").exists(), disk))
    assert it.steps(20) is False
    assert isinstance(it.events[-1], m.ClipTrained)
    assert disk.n_refused == 1
    assert it.of(m.WarningRaised) == []
    assert sorted(path.name for path in prep.iterdir()) == ["backgrounds.safetensors", "clip-0001-0.safetensors"]


def full_while(is_full, disk: Disk):
    replace = os.replace

    def act(source, target):
        disk.is_full = is_full()
        replace(source, target)

    return act


def test_without_a_window_it_gives_up_after_some_tries_and_the_same_command_finishes(bench, monkeypatch):
    it = without_window(bench(n_steps=5))
    assert it.steps(10) is False
    expected = finished(it)
    it.handed_over.unlink()  # and the same once more
    it.checkpoint.unlink(missing_ok=True)
    it.start()
    disk = Disk(monkeypatch, HANDED_OVER)
    assert it.steps(200) is False
    assert 2 <= disk.n_refused <= 6
    failed = it.events[-1]
    assert isinstance(failed, m.TrainingFailed)
    assert failed.kind == "DiskError"
    assert "No space left on device" in failed.message
    assert "Step 5 is kept; training again with the same command resumes from there." in failed.message
    assert "bug in the program" not in failed.message + failed.hint
    disk.is_full = False
    it.start()
    assert it.steps(20) is False
    assert isinstance(it.events[-1], m.ClipTrained)
    assert finished(it).keys() == expected.keys()
    assert all((finished(it)[name] == expected[name]).all() for name in expected)


def test_where_nothing_can_be_kept_it_waits_longer_and_says_so(bench, monkeypatch):
    it = without_window(bench(n_steps=5))
    Disk(monkeypatch, HANDED_OVER, "checkpoints")
    assert it.steps(int(disk_retries.PATIENCE_UNKEPT_S) - 5) is True
    assert "in memory only" in it.of(m.WarningRaised)[-1].detail
    assert it.steps(60) is False
    assert "Step 5 could not be kept; training again starts from the beginning." in it.events[-1].message


def test_a_clip_that_waits_for_room_can_be_stopped(bench, monkeypatch):
    it = bench(n_steps=5)
    Disk(monkeypatch, HANDED_OVER)
    it.steps(8)
    it.commands.append(Stop(keep=True))
    assert it.steps(1) is False
    assert it.events[-1] == m.TrainingStopped(True, 5)


def test_a_failure_between_steps_keeps_what_was_learned(bench):
    def break_measuring(it):
        def measure():
            if it.training.steps_done:
                raise CaptureError("The picture is damaged.")
            return 20.0

        it.training.held_out_psnr = measure

    it = bench(change=break_measuring)
    assert it.steps(20) is False
    failed = it.events[-1]
    assert failed.kind == "CaptureError"
    step = read_clip_state(it.checkpoint).header.step
    assert step > 0
    assert f"Step {step} is kept" in failed.message


@pytest.mark.parametrize("is_moved", [False, True])
@pytest.mark.parametrize("at", ["step", "stop", "pause", "finish"])
def test_a_project_that_is_gone_is_noticed_and_not_made_again(bench, is_moved, at, tmp_path):
    it = bench(n_steps=5 if at == "finish" else 100)
    it.steps(3)
    if is_moved:
        it.project.folder.rename(tmp_path / "elsewhere")
    else:
        shutil.rmtree(it.project.folder)
    if at == "stop":
        it.commands.append(Stop(keep=True))
    if at == "pause":
        it.commands.append(Pause())
    assert it.steps(50) is False
    failed = it.events[-1]
    assert isinstance(failed, m.TrainingFailed)
    assert failed.kind == "ProjectGone"
    assert "deleted or moved" in failed.message
    assert not it.project.folder.exists()


def test_another_folder_in_the_place_of_a_project_is_left_alone(bench, tmp_path):
    it = bench()
    it.steps(3)
    it.project.folder.rename(tmp_path / "elsewhere")
    shutil.copytree(tmp_path / "elsewhere", it.project.folder)
    before = sorted(it.project.folder.rglob("*"))
    assert it.steps(50) is False
    assert it.events[-1].kind == "ProjectGone"
    assert "another folder" in it.events[-1].message
    assert set(it.project.folder.rglob("*")) <= set(before)


def test_the_command_ends_with_1_deletes_nothing_and_goes_on_with_room(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(disk_retries, "PATIENCE_S", 0.0)
    disk = Disk(monkeypatch, HANDED_OVER)
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    code, _, err = run(*arguments)
    assert code == 1
    assert "No space left on device" in err
    assert "bug in the program" not in err
    assert (tmp_path / "p" / "checkpoints" / "0000.safetensors").is_file()
    disk.is_full = False
    code, out, err = run(*arguments, "--json")
    assert (code, err.count("is trained")) == (0, 1)
    assert '"state": "trained"' in out


def test_a_new_project_in_which_something_was_learned_is_not_taken_back(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", make_training=_breaks_at_the_end)
    assert code == 2
    assert "The picture is damaged" in err
    assert read_clip_state(tmp_path / "p" / "checkpoints" / "0000.safetensors").header.step > 0


def test_nor_is_one_whose_checkpoint_could_not_be_written(run, capture_folder, tmp_path, monkeypatch):
    Disk(monkeypatch, "checkpoints")
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", make_training=_breaks_at_the_end)
    assert code == 2
    assert "could not be kept" in err
    assert (tmp_path / "p" / "project.json").is_file()


def _breaks_at_the_end(job, store, report):
    training = make_fake(job, store, report)

    def measure() -> float:
        if training.steps_done:
            raise CaptureError("The picture is damaged.")
        return 20.0

    training.held_out_psnr = measure
    return training


def test_a_project_deleted_while_training_ends_with_1_and_is_not_made_again(run, capture_folder, tmp_path):
    def deletes_itself(job, store, report):
        training = make_fake(job, store, report)
        ordinary = training.step

        def step(n=1):
            if training.steps_done == 2:
                shutil.rmtree(store.folder)
            return ordinary(n)

        training.step = step
        return training

    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", make_training=deletes_itself)
    assert code == 1
    assert "The project folder is gone" in err
    assert not (tmp_path / "p").exists()
