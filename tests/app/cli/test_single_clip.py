"""clipgstream train --clip K: one clip, any number of times, at the same time by mistake too; its exit codes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from app.cli import single_clip
from app.cli.cli import main
from app.evaluation import headless
from app.project.claims import claims as claims_module
from app.project.claims.asks import ask_holder
from app.project.claims.claim_files import CLAIMS, ClaimFile, holder_path, list_claims, make_claim
from app.project.claims.claims import Claims
from app.project.claims.holder_record import HolderRecord, write_holder
from app.project.lock import this_process
from app.project.opening.project_access import open_project, read_settings
from engine.clip_files.clip_state import read_clip_header
from tests.app.conftest import DEADLINE_S
from tests.app.fakes import N_STEPS, make_fake, make_slow, write_capture

ROOT = Path(__file__).resolve().parents[3]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def train(run: Run, capture_folder: Path, tmp_path: Path) -> Run:
    """Trains a clip of two frames; gives exit code, standard output and standard error."""

    def train_clip(clip_index: int, *more: object, capture: Path = capture_folder, **options: Any):
        words = ("train", capture, "--project", tmp_path / "p", "--clip-length", 2, "--clip", clip_index)
        return run(*words, *more, **options)

    return train_clip


def never(*_: object) -> None:
    raise AssertionError("nothing is to be trained")


def of_another_computer(project: Path, key: str) -> HolderRecord:
    """A claim whose holder cannot be asked for here."""
    (project / CLAIMS).mkdir(exist_ok=True)
    record = HolderRecord("f" * 32, replace(this_process(), host="render-7", boot="another", pid=1))
    write_holder(holder_path(project, record.token), record)
    make_claim(ClaimFile(project, key, 1), record.token)
    return record


def test_one_finished_clip_results_however_often_it_is_run(train: Run, tmp_path: Path) -> None:
    project = tmp_path / "p"
    code, _, err = train(1)
    assert code == 75
    assert "Clip 1 needs clip 0, which is not trained yet." in err
    assert train(0)[0] == 0
    assert train(1, "--json")[0] == 0
    before = (project / "clips" / "0001.safetensors").stat().st_mtime_ns
    code, out, _ = train(1, "--json", make_training=never)
    assert code == 0
    assert json.loads(out)["clips"][0]["state"] == "skipped"
    assert (project / "clips" / "0001.safetensors").stat().st_mtime_ns == before
    assert not (project / "versions").exists()
    assert list((project / CLAIMS).iterdir()) == []
    assert not (project / "lock").exists()


def test_it_trains_beside_whoever_has_the_project_open(train: Run, run: Run, capture_folder: Path, tmp_path: Path):
    assert train(0)[0] == 0
    project = open_project(tmp_path / "p")
    assert train(1)[0] == 0
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p")
    assert code == 2
    assert "has this project open for writing" in err, "two drivers of one project"
    project.close()
    assert (tmp_path / "p" / "clips" / "0001.safetensors").is_file()


def test_a_clip_that_another_process_trains_is_not_ready(train: Run, tmp_path: Path) -> None:
    assert train(0)[0] == 0
    other = Claims(tmp_path / "p", has_thread=False)
    other.take("0001")
    code, _, err = train(1, make_training=never)
    assert code == 75
    assert "trains this clip. Wait for it, or stop it there." in err
    other.check("0001")
    other.close()
    assert train(1)[0] == 0


def test_a_clip_of_a_computer_that_died_is_taken_over_after_a_while(train: Run, tmp_path: Path, monkeypatch) -> None:
    assert train(0)[0] == 0
    of_another_computer(tmp_path / "p", "0001")
    monkeypatch.setattr(claims_module, "DEAD_AFTER_S", 0.1)
    monkeypatch.setattr(single_clip, "LOOK_EVERY_S", 0.02)
    code, _, err = train(1)
    assert code == 0, err
    assert "computer render-7 (process 1) trains this clip. Waiting for up to a minute for a sign of life." in err
    assert list_claims(tmp_path / "p") == {}


def test_one_that_turns_out_to_live_is_left_to_it(train: Run, tmp_path: Path, monkeypatch) -> None:
    assert train(0)[0] == 0
    record = of_another_computer(tmp_path / "p", "0001")

    def beat(_: float) -> None:
        write_holder(holder_path(tmp_path / "p", record.token), msgspec.structs.replace(record, beat=7))

    monkeypatch.setattr(single_clip.time, "sleep", beat)
    assert train(1, make_training=never)[0] == 75


def test_a_failure_keeps_progress_and_the_next_run_continues(train: Run, tmp_path: Path) -> None:
    def make_failing(*arguments: Any) -> Any:
        training = make_fake(*arguments)
        training.fails_at = 3
        return training

    begun = list[int]()

    def make_continuing(*arguments: Any) -> Any:
        training: Any = make_fake(*arguments)
        restore = training.restore_checkpoint
        training.restore_checkpoint = lambda path: (restore(path), begun.append(training.steps_done))
        return training

    code, _, err = train(0, make_training=make_failing)
    assert code == 1
    assert "became nan at step 4" in err
    assert list((tmp_path / "p" / CLAIMS).iterdir()) == []
    assert train(0, make_training=make_continuing)[0] == 0
    assert begun == [3]
    header = read_clip_header(tmp_path / "p" / "clips" / "0000.safetensors")
    assert header is not None
    assert header.step == N_STEPS


def test_an_interruption_keeps_progress_and_frees_the_clip(train: Run, tmp_path: Path, monkeypatch) -> None:
    shown = list[object]()

    def interrupt(service: Any) -> object:
        shown.append(headless_status(service))
        if len(shown) == 3:
            raise KeyboardInterrupt
        return shown[-1]

    headless_status = headless.training_status
    monkeypatch.setattr(headless, "training_status", interrupt)
    code, _, err = train(0, make_training=make_slow)
    assert code == 130
    assert "Interrupted." in err
    assert (tmp_path / "p" / "checkpoints" / "0000.safetensors").is_file()
    assert list((tmp_path / "p" / CLAIMS).iterdir()) == []


def test_one_that_others_stop_says_so_with_a_code_of_its_own(train: Run, tmp_path: Path, monkeypatch) -> None:
    look, has_stepped = Claims.look_after_held, threading.Event()

    def look_when_asked(claims: Claims) -> None:
        if has_stepped.is_set():  # before, there is nothing to keep
            ask_holder(claims.folder, "0000", "stop")
        look(claims)

    def make_stepping(*arguments: Any) -> Any:
        training: Any = make_slow(*arguments)
        step = training.step
        training.step = lambda n=1: (has_stepped.set(), step(n))[1]
        return training

    monkeypatch.setattr(Claims, "look_after_held", look_when_asked)
    monkeypatch.setattr(claims_module, "BEAT_EVERY_S", 0.02)
    code, _, err = train(0, make_training=make_stepping)
    assert code == 3
    assert "The training of clip 0 was stopped; progress is kept." in err
    assert (tmp_path / "p" / "checkpoints" / "0000.safetensors").is_file()


def test_one_that_lost_its_claim_leaves_the_clip_to_the_other(train: Run, tmp_path: Path, monkeypatch) -> None:
    """It was halted; the other has taken over, and trains."""
    shown = list[object]()

    def take_over(service: Any) -> object:
        if len(shown) == 3:
            make_claim(ClaimFile(tmp_path / "p", "0000", 2), "a" * 32)
            service.claims.look()
        shown.append(status(service))
        return shown[-1]

    status = headless.training_status
    monkeypatch.setattr(headless, "training_status", take_over)
    code, _, err = train(0, make_training=make_slow)
    assert code == 75
    assert "Nothing is lost: the other one continues." in err
    assert [claim.number for claim in list_claims(tmp_path / "p").values()] == [2]
    assert not (tmp_path / "p" / "clips").exists()


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (["--clip", "3"], "There is no clip 3; clips are 0 to 2."),
        (["--clip", "-1"], "There is no clip -1"),
        (["--clip", "x"], "invalid int value"),
        (["--seed", "4"], "The project has seed 0"),
        (["--preset", "toy"], "single clips are trained with its settings"),
        (["--again"], "--clip cannot be combined with --again"),
        (["--start-over"], "--clip cannot be combined with --start-over"),
        (["--clips", "0:1"], "--clip cannot be combined with --clips"),
        (["--clip-set", "joint_steps=3"], "--clip cannot be combined with --clip-set"),
    ],
)
def test_bad_input_is_not_tried_again(train: Run, more: list[str], expected: str, tmp_path: Path) -> None:
    train(1)  # makes the project
    before = (tmp_path / "p" / "project.json").read_bytes()
    code, _, err = train(0, *more, make_training=never)
    assert code == 2
    assert expected in err
    assert (tmp_path / "p" / "project.json").read_bytes() == before


def test_a_computer_without_the_capture_says_so(train: Run, tmp_path: Path, capture_folder: Path) -> None:
    code, _, err = train(0, capture=tmp_path / "nowhere")
    assert code == 2
    assert "nowhere" in err
    assert not (tmp_path / "p").exists()
    assert train(0)[0] == 0
    assert train(1, capture=tmp_path / "nowhere")[0] == 2
    other = write_capture(tmp_path / "other", n_cameras=5)
    code, _, err = train(1, capture=other)
    assert code == 2
    assert "made for another capture" in err


def test_the_capture_may_lie_elsewhere_on_each_computer(train: Run, tmp_path: Path, capture_folder: Path) -> None:
    assert train(0)[0] == 0
    shutil.copytree(capture_folder, tmp_path / "here")
    assert train(1, capture=tmp_path / "here")[0] == 0
    assert read_settings(tmp_path / "p").capture == str(capture_folder.resolve())


def test_a_folder_of_claims_that_is_none_is_refused(train: Run, tmp_path: Path) -> None:
    assert train(0)[0] == 0
    (tmp_path / "p" / CLAIMS).rmdir()
    (tmp_path / "elsewhere").mkdir()
    for make in (lambda path: path.symlink_to(tmp_path / "elsewhere"), Path.touch):
        make(tmp_path / "p" / CLAIMS)
        code, _, err = train(1, make_training=never)
        assert code == 2
        assert 'its folder "claims" cannot be used' in err
        (tmp_path / "p" / CLAIMS).unlink()
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_disk_that_refuses_the_claim_is_a_failure_that_leaves_nothing(train: Run, tmp_path: Path, monkeypatch):
    assert train(0)[0] == 0
    monkeypatch.setattr(
        claims_module, "make_claim", lambda *_: (_ for _ in ()).throw(OSError(122, "Disk quota exceeded"))
    )
    code, _, err = train(1, make_training=never)
    assert code == 1
    assert "The claim of the clip could not be written (Disk quota exceeded)" in err
    assert list((tmp_path / "p" / CLAIMS).iterdir()) == []


def test_a_damaged_reference_is_for_the_user_to_decide_on(train: Run, tmp_path: Path) -> None:
    assert train(0)[0] == 0
    (tmp_path / "p" / "clips" / "0000.safetensors").write_bytes(b"x")
    code, _, err = train(1, make_training=never)
    assert code == 2
    assert "it needs clip 0, which is damaged" in err


def test_of_many_that_make_the_project_all_find_it(train: Run, tmp_path: Path, monkeypatch) -> None:
    """Another one makes it just now, and is killed; the next attempt makes it."""
    from app.cli import chosen_project

    (tmp_path / "p" / "journal").mkdir(parents=True)
    busy, waited = open_lock(tmp_path / "p"), list[float]()

    def wait(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 3:
            busy.release()

    monkeypatch.setattr(chosen_project.time, "sleep", wait)
    assert train(0)[0] == 0
    assert len(waited) >= 3


def open_lock(folder: Path) -> Any:
    from app.project.lock import ProcessLock

    lock = ProcessLock(folder / "lock")
    lock.acquire()
    return lock


SCRIPT = """
import sys
from functools import partial
from app.cli.cli import main
from app.training.process import ProcessWorker

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], launch=partial(ProcessWorker, make="tests.app.fakes:make_slow")))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no signals to groups")
def test_a_scheduler_that_ends_the_whole_group_loses_nothing(capture_folder: Path, tmp_path: Path) -> None:
    """As SLURM does at the end of a job's time: the worker gets the signal, too."""
    script = tmp_path / "one.py"
    script.write_text(SCRIPT)
    words = ["train", str(capture_folder), "--project", str(tmp_path / "p"), "--clip", "0", "--quiet"]
    process = subprocess.Popen(
        [sys.executable, str(script), *words],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        start_new_session=True,
    )
    curves = tmp_path / "p" / "metrics" / "0000.unfinished.jsonl"
    try:
        until_s = time.monotonic() + DEADLINE_S
        while not (curves.is_file() and "train_psnr" in curves.read_text()):
            assert time.monotonic() < until_s
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.1)
        os.killpg(process.pid, signal.SIGTERM)
        _, err = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    header = read_clip_header(tmp_path / "p" / "checkpoints" / "0000.safetensors")
    assert header is not None
    assert header.step > 0
    assert list((tmp_path / "p" / CLAIMS).iterdir()) == []
    assert main(["train", str(capture_folder), "--project", str(tmp_path / "p"), "--clip", "9"]) == 2
