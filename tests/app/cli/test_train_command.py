"""clipgstream train: exit codes, messages, outputs; training inline."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.cli import main
from app.cli.terminal.exit_codes import exit_code
from app.cli.terminal.training_lines import failure_text
from app.evaluation.headless import ClipOutcome
from app.project.opening.project_access import open_project, read_settings
from engine.clip_files.clip_state import read_clip_state
from tests.app.fakes import N_STEPS, make_fake, write_capture

ROOT = Path(__file__).resolve().parents[3]


def test_training_writes_clips_and_a_document(run, capture_folder, tmp_path):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--json")
    assert code == 0, err
    document = json.loads(out)
    assert document["schema"] == 1
    assert document["holdout"] == ["0"]
    assert [(clip["clip_index"], clip["state"], clip["steps"]) for clip in document["clips"]] == [
        (0, "trained", N_STEPS),
        (1, "trained", N_STEPS),
    ]
    assert read_clip_state(tmp_path / "p" / "clips" / "0001.safetensors").header.role == "source"
    assert "held-out PSNR ~26.00 dB, few pictures" in err
    open_project(tmp_path / "p").close()  # the lock was given back


def test_trained_clips_are_not_trained_again(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    assert run(*arguments, "--clips", "0:1")[0] == 0
    before = (tmp_path / "p" / "clips" / "0000.safetensors").stat().st_mtime_ns
    code, out, _ = run(*arguments, "--json")
    assert code == 0
    assert [clip["state"] for clip in json.loads(out)["clips"]] == ["skipped", "trained"]
    assert (tmp_path / "p" / "clips" / "0000.safetensors").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--clips", "0:9"], "clips 0 to 0"),
        (["--clips", "x"], "not a range A:B"),
        (["--clips", "1:1"], "empty or out of range"),
        (["--holdout", "0,99"], "no camera '99'"),
        (["--holdout", "0,1,2"], "leaves 1 for training"),
        (["--scale", "0"], "scale is 0"),
        (["--scale", "2"], "scale is 2"),
        (["--scale", "nan"], "scale is nan"),
        (["--scale", "wide"], "invalid float value"),
        (["--clip-length", "0"], "allows 1 to 6"),
        (["--clip-length", "70"], "allows 1 to 6"),
        (["--seed", "-4"], "seed is -4"),
        (["--set", "joint_steps"], "no '='"),
        (["--set", "nonsense=1"], "does not exist"),
        (["--set", "ssim_weight=5"], "between 0 and 1"),
        (["--set", "joint_steps=many"], "has to be a whole number"),
        (["--set", "independent=maybe"], "has to be true or false"),
        (["--clip", "1"], "There is no clip 1; clips are 0 to 0."),
        (["--plan", "--clip", "0"], "--plan cannot be combined with --clip. Write --clips 0 "),
        (["--plan", "--cluster", "auto"], "--plan cannot be combined with --cluster. Write --workers N "),
        (["--cluster", "local:2", "--workers", "2"], "--cluster cannot be combined with --workers."),
    ],
)
def test_bad_arguments_end_with_2_and_leave_nothing_behind(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", *arguments)
    assert code == 2
    assert expected in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize("more", [[], ["--workers", "2"], ["--cluster", "local:1"]])
def test_a_second_driver_of_a_project_is_refused_and_changes_nothing(run, make_opened, more) -> None:
    opened = make_opened()
    folder = opened.project.folder
    before = sorted(folder.rglob("*"))
    code, out, err = run("train", opened.capture.path, "--project", folder, *more)
    assert (code, out) == (2, "")
    assert "has this project open for writing" in err
    assert sorted(folder.rglob("*")) == before


def test_a_damaged_picture_found_while_training_is_bad_input(run, tmp_path):
    folder = write_capture(tmp_path / "c")
    code, _, err = run("train", folder, "--project", tmp_path / "p", make_training=_reads_pictures)
    assert code == 0, err
    bad = folder / "ims" / "2" / "000003.jpg"
    bad.write_bytes(bad.read_bytes()[:200])
    code, _, err = run("train", folder, "--project", tmp_path / "q", make_training=_reads_pictures)
    assert code == 2
    assert err.rstrip().endswith("000003.jpg")  # cause, what to do, and the file last
    assert "Traceback" not in err
    assert not (tmp_path / "q").exists()
    (tmp_path / "r").mkdir()  # the user's own folder stays, and stays empty
    assert run("train", folder, "--project", tmp_path / "r", make_training=_reads_pictures)[0] == 2
    assert not list((tmp_path / "r").iterdir())
    code, _, err = run("train", folder, "--project", tmp_path / "p", make_training=_reads_pictures)
    assert read_clip_state(tmp_path / "p" / "clips" / "0000.safetensors").header.step == N_STEPS  # what was learned


def _reads_pictures(job, store, report):
    training = make_fake(job, store, report)

    def prepare() -> None:
        for camera_index in range(4):
            training.capture.frames_of(camera_index, range(6))

    training.prepare = prepare
    return training


def test_a_failure_ends_with_1_and_keeps_what_was_learned(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--set", "static_steps=4")
    assert code == 1
    assert "nan at step 5" in err
    assert "Lower the rates." in err
    assert (tmp_path / "p" / "checkpoints" / "0000.safetensors").is_file()


def test_options_that_contradict_a_trained_project_are_refused(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    assert run(*arguments, "--clip-length", 3, "--clips", "0")[0] == 0
    code, _, err = run(*arguments, "--clip-length", 2)
    assert code == 2
    assert "clip_length 3" in err
    assert run(*arguments, "--clip-length", 3)[0] == 0  # the same value is not a contradiction


def test_settings_may_change_until_a_clip_is_finished(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    assert run(*arguments, "--preset", "toy", "--set", "static_steps=4")[0] == 1  # it fails at step 5, which is kept
    assert (tmp_path / "p" / "checkpoints" / "0000.safetensors").is_file()
    code, _, err = run(*arguments, "--preset", "small")
    assert code == 0, err
    assert "Discarded: the progress of clip 0 (step " in err
    assert read_clip_state(tmp_path / "p" / "clips" / "0000.safetensors").header.step == N_STEPS
    assert read_settings(tmp_path / "p").overrides == {}  # another preset takes the place of all that was set


def test_starting_over_discards_what_is_trained_and_takes_other_settings(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    assert run(*arguments, "--preset", "toy")[0] == 0
    before = (tmp_path / "p" / "clips" / "0001.safetensors").stat().st_mtime_ns
    assert run(*arguments, "--preset", "small")[0] == 2
    assert run(*arguments, "--start-over", "--clips", "7")[0] == 2
    assert (tmp_path / "p" / "clips" / "0001.safetensors").stat().st_mtime_ns == before  # bad input discards nothing
    code, _, err = run(*arguments, "--preset", "small", "--start-over", "--clips", "0")
    assert code == 0, err
    assert re.search(r"Discarded: 2 trained clips \(\d+:\d\d of training\), \d+(\.\d)? [kM]B", err)
    assert [path.stem for path in (tmp_path / "p" / "clips").iterdir()] == ["0000"]
    assert read_settings(tmp_path / "p").overrides == {}


def test_a_source_clip_alone_is_refused(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--clips", "1:2")
    assert code == 2
    assert "needs the reference clip 0" in err


INTERRUPTED = """
import os, signal, sys
from functools import partial
from app.cli.cli import main
from app.training.process import ProcessWorker

class Interrupting(ProcessWorker):
    def poll(self):
        events = super().poll()
        if any(getattr(event, "step", 0) > 0 for event in events):
            os.kill(os.getpid(), getattr(signal, sys.argv[3]))
        return events

if __name__ == "__main__":
    # whatever started the tests in the background made its children ignore Ctrl+C; a terminal does not
    signal.signal(signal.SIGINT, signal.default_int_handler)
    launch = lambda job, project: Interrupting(job, project, "tests.app.fakes:make_slow")
    sys.exit(main(["train", sys.argv[1], "--project", sys.argv[2], "--quiet"], launch=launch))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_interrupting_stops_cleanly_and_keeps_what_was_learned(tmp_path, capture_folder, name):
    assert hasattr(signal, name)
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    done = subprocess.run(
        [sys.executable, str(script), str(capture_folder), str(tmp_path / "p"), name],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
    )
    assert done.returncode == 130, done.stderr
    assert "Progress is kept" in done.stderr
    assert "Traceback" not in done.stderr
    assert read_clip_state(tmp_path / "p" / "checkpoints" / "0000.safetensors").header.step > 0
    open_project(tmp_path / "p").close()


@pytest.mark.slow
def test_a_dead_worker_ends_with_1(capture_folder, tmp_path, capsys):
    from app.training.process import ProcessWorker

    code = main(
        ["train", str(capture_folder), "--project", str(tmp_path / "p"), "--quiet"],
        launch=lambda job, project: ProcessWorker(job, project, "tests.app.fakes:make_crashing"),
    )
    err = capsys.readouterr().err
    assert code == 1
    assert "ended by signal 9" in err
    assert "clip-0000.log" in err


def test_a_training_that_somebody_stopped_is_no_finished_one() -> None:
    outcomes = [ClipOutcome(0, "trained"), ClipOutcome(1, "stopped", 5), ClipOutcome(2, "left_out", left_out_by=1)]
    assert exit_code(outcomes) == 3
    assert failure_text(outcomes).splitlines() == [
        "Not begun, because clip 1 is not finished: clip 2.",
        "Stopped from elsewhere, with progress kept: clip 1.",
    ]
    assert exit_code([*outcomes, ClipOutcome(3, "failed", kind="ProjectError")]) == 2
    assert exit_code([ClipOutcome(0, "damaged")]) == 2, "trying again does not mend a file"
    assert exit_code([ClipOutcome(0, "damaged"), ClipOutcome(1, "failed", kind="WorkerDied")]) == 1
    assert exit_code([ClipOutcome(0, "trained"), ClipOutcome(1, "skipped")]) == 0
