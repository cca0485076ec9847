"""The command line: exit codes, messages, outputs; training inline."""

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from app import cli
from app.arguments import parse_range
from app.cli import main
from app.progress import ProgressLine, duration_text
from app.project import open_project, read_settings
from app.results import check_writable
from app.video import write_pictures, write_video
from engine.errors import ProjectError
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.conftest import inline
from tests.app.fakes import N_STEPS, make_crashing, make_fake, write_capture

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]):
    """Runs a command; gives exit code, standard output and standard error."""

    def run_command(*arguments: object, make_training=make_fake) -> tuple[int, str, str]:
        code = main([str(part) for part in arguments], launch=partial(inline, make_training=make_training))
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_command


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
    assert read_clip_state(tmp_path / "p" / "clips" / "0001.safetensors").header["role"] == "source"
    assert "held-out PSNR 26.00 dB" in err
    open_project(tmp_path / "p").close()  # the lock was given back


def test_a_plan_is_printed_and_nothing_is_made(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--plan")
    code, out, err = run(*arguments, "--set", "source_steps=7")
    assert code == 0, err
    assert not (tmp_path / "p").exists()
    assert re.search(
        r"Clip 0, frames 0 to 2, reference\n  pictures +9  3 cameras \(1 held out\) x 3 frames, 32x24", out
    )
    assert re.search(r"source steps +7  as set", out)
    assert "forecast: made up for a test" in out
    assert re.search(r"All 2 clips: about \d+:\d\d, at most 0\.\d GB of memory", out)


def test_a_plan_as_json(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    code, out, err = run(*arguments, "--plan", "--json", "--preset", "toy")
    assert code == 0, err
    document = json.loads(out)
    assert document.keys() == {"schema", "project", "capture", "holdout", "settings", "clips", "forecast"}
    assert (document["schema"], document["holdout"]) == (1, ["0"])
    assert document["settings"]["passes"] == 4
    assert [(clip["clip_index"], clip["state"], clip["role"]) for clip in document["clips"]] == [
        (0, "planned", "reference"),
        (1, "planned", "source"),
    ]
    first = document["clips"][0]
    assert first.keys() == {"clip_index", "start", "n_frames", "role", "n_steps", "forecast", "lines", "state"}
    assert first["n_steps"] == 300 + 36
    for name in ("preparation_s", "training_s"):
        together = sum(clip["forecast"][name] for clip in document["clips"])
        assert document["forecast"][name] == pytest.approx(together, abs=0.1)
    assert run(*arguments, "--clips", "0")[0] == 0
    document = json.loads(run(*arguments, "--plan", "--json")[1])
    assert [(clip["clip_index"], clip["state"]) for clip in document["clips"]] == [(0, "trained"), (1, "planned")]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--clips", "9"], "clips 0 to 0"),
        (["--preset", "huge"], "no preset called 'huge'"),
        (["--set", "patience=-1"], "patience is -1"),
        (["--holdout", "0,1,2"], "leaves 1 for training"),
    ],
)
def test_a_plan_that_cannot_be_is_bad_input(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", "--plan", *arguments)
    assert (code, out) == (2, "")
    assert expected in err
    assert not (tmp_path / "p").exists()


def test_a_plan_of_a_trained_project_with_other_settings_is_refused(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    assert run(*arguments)[0] == 0
    code, _, err = run(*arguments, "--plan", "--set", "passes=3")
    assert code == 2
    assert "cannot change any more" in err
    code, out, _ = run(*arguments, "--plan")
    assert (code, out) == (0, "Trained already: clip 0\n")


def test_training_says_its_plan_and_how_right_it_was(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    _, _, err = run(*arguments)
    assert re.search(r"Clip 0: 1,500 steps, about \d+:\d\d \(\d+:\d\d preparation\), 0\.\d GB of memory", err)
    assert "Times: made up for a test" in err
    assert re.search(r"Times: cost model times \S+, as measured on clip 0 of the other kind", err)
    figures = r"preparation \S+ against \S+ s, training \S+ against \S+ s, memory \S+ against \S+ MB, stored"
    assert len(re.findall(f"Forecast against measured: {figures}", err)) == 2
    assert "Forecast" not in run(*arguments)[2]  # trained already


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
        (["--clips", "x"], "no range A:B"),
        (["--clips", "1:1"], "empty or reaches outside"),
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
        (["--set", "ssim_weight=5"], "between 0.0 and 1.0"),
        (["--set", "joint_steps=many"], "not a whole number"),
        (["--set", "independent=maybe"], "not true or false"),
    ],
)
def test_bad_arguments_end_with_2_and_leave_nothing_behind(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", *arguments)
    assert code == 2
    assert expected in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "p").exists()


def test_a_folder_that_is_no_capture(run, tmp_path):
    (tmp_path / "holiday").mkdir()
    for command in (["inspect", tmp_path / "holiday"], ["train", tmp_path / "holiday", "--project", tmp_path / "p"]):
        code, _, err = run(*command)
        assert code == 2
        assert "no capture" in err
        assert str(tmp_path / "holiday") in err
    assert not (tmp_path / "p").exists()


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
    assert read_clip_state(tmp_path / "p" / "clips" / "0000.safetensors").header["step"] == N_STEPS  # what was learned


def _reads_pictures(job, report):
    training = make_fake(job, report)

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


def test_a_fault_of_the_program_is_one_line_and_in_the_log(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr("app.cli.open_capture", lambda *_args, **_kwargs: 1 / 0)
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p")
    assert code == 1
    assert err.count("\n") == 1
    assert "fault of the program" in err
    log = Path(err.rpartition("Details are in ")[2].strip().rstrip("."))
    assert "ZeroDivisionError" in log.read_text()


def test_options_that_contradict_a_trained_project_are_refused(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    assert run(*arguments, "--clip-length", 3, "--clips", "0")[0] == 0
    code, _, err = run(*arguments, "--clip-length", 2)
    assert code == 2
    assert "clip_length 3" in err
    assert run(*arguments, "--clip-length", 3)[0] == 0  # the same value is no contradiction


def test_a_source_clip_alone_is_refused(run, capture_folder, tmp_path):
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--clips", "1:2")
    assert code == 2
    assert "needs the reference clip 0" in err


@pytest.mark.parametrize("command", ["eval", "render"])
def test_measuring_needs_something_trained(run, capture_folder, tmp_path, command):
    extra = ["--json", tmp_path / "o.json"] if command == "eval" else ["--camera", "1", "--out", tmp_path / "o.mp4"]
    code, _, err = run(command, tmp_path / "nowhere", *extra)
    assert code == 2
    assert "There is no such folder" in err
    (tmp_path / "empty").mkdir()
    code, _, err = run(command, tmp_path / "empty", *extra)
    assert code == 2
    assert "no project" in err
    run("train", capture_folder, "--project", tmp_path / "p", "--set", "static_steps=1")  # fails early
    code, _, err = run(command, tmp_path / "p", *extra)
    assert code == 2
    assert "Nothing is trained" in err
    assert not list(tmp_path.glob("o.*"))


def test_rendering_names_what_is_wrong_with_its_arguments(run, capture_folder, tmp_path):
    run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--clips", "0")
    render = ("render", tmp_path / "p", "--out", tmp_path / "o.mp4")
    for extra, expected in (
        (("--camera", "9"), "no camera '9'"),
        (("--camera", "0,1"), "one camera"),
        (("--camera", "1", "--frames", "4:99"), "frames 0 to 5"),
        (("--camera", "1", "--frames", "0:6"), "need clips [1]"),
        (("--camera", "1", "--frames", "0:2", "--out", tmp_path / "o.gif"), "no known video"),
    ):
        code, _, err = run(*render, *extra)
        assert (code, expected in err) == (2, True), err
    assert not list(tmp_path.glob("o.*"))


def test_a_damaged_clip_is_named_before_anything_is_written(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "engine.model.clip_model.load_clip_model", lambda state, reference: state
    )  # fakes hold no model
    run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    clip = tmp_path / "p" / "clips" / "0001.safetensors"
    clip.write_bytes(clip.read_bytes()[:-10])
    for command in (
        ("render", tmp_path / "p", "--camera", "1", "--out", tmp_path / "pictures"),
        ("render", tmp_path / "p", "--camera", "1", "--out", tmp_path / "o.mp4"),
        ("eval", tmp_path / "p", "--json", tmp_path / "o.json"),
    ):
        code, _, err = run(*command)
        assert code == 2
        assert err.rstrip().endswith(f"Train the clip again. - {clip}")
    assert not list(tmp_path.glob("o.*"))
    assert not (tmp_path / "pictures").exists()


def test_results_that_cannot_be_written_are_refused_before_the_work(run, capture_folder, tmp_path):
    (tmp_path / "file").write_text("")
    for out, expected in ((tmp_path / "file" / "o.json", "is a file"), (tmp_path, "is a folder")):
        with pytest.raises(ProjectError, match=expected):
            check_writable(out)
        code, _, err = run("eval", tmp_path / "p", "--json", out)
        assert (code, expected in err) == (2, True), err
    check_writable(tmp_path / "new" / "deep" / "o.json")
    assert [path.name for path in tmp_path.iterdir() if path.name in ("file", "new")] == ["file"]


def test_a_folder_that_may_not_be_looked_into_is_named(run, capture_folder, tmp_path, monkeypatch):
    locked = tmp_path / "locked" / "p"
    real_stat = Path.stat

    def stat(self: Path, **options):
        if self == locked or locked in self.parents:
            raise PermissionError(13, "Permission denied", str(self))
        return real_stat(self, **options)

    monkeypatch.setattr(Path, "stat", stat)  # root may look into everything, so that rights alone would not do
    code, _, err = run("train", capture_folder, "--project", locked)
    assert (code, err) == (2, f"clipgstream: Permission denied. Choose a folder you may use. - {locked}\n")


def test_a_capture_that_has_moved_is_said_and_found_again(run, tmp_path):
    folder = write_capture(tmp_path / "c")
    project = tmp_path / "p"
    assert run("train", folder, "--project", project)[0] == 0
    folder.rename(tmp_path / "d")
    code, _, err = run("eval", project, "--json", "-")
    assert code == 2
    assert f"clipgstream train NEW_PLACE --project {project} - {folder}" in err
    assert run("train", tmp_path / "d", "--project", project)[0] == 0
    assert read_settings(project).capture == str(tmp_path / "d")


def test_inspecting_prints_stable_json(run, capture_folder):
    code, out, _ = run("inspect", capture_folder, "--json")
    assert code == 0
    document = json.loads(out)
    assert (document["schema"], document["n_cameras"], document["n_frames"]) == (1, 4, 6)
    code, out, _ = run("inspect", capture_folder)
    assert code == 0
    assert "4 cameras, 6 frames" in out


def test_inspecting_a_project_counts_the_bytes_of_its_clips(run, capture_folder, tmp_path):
    project, capture = tmp_path / "p", tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    assert run("train", capture, "--project", project, "--clip-length", 3)[0] == 0
    code, out, _ = run("inspect", project, "--json")
    assert code == 0
    found = json.loads(out)
    sizes = [(project / "clips" / f"000{i}.safetensors").stat().st_size for i in range(2)]
    assert [clip["n_bytes"] for clip in found["clips"]] == sizes
    assert [sum(clip["components"].values()) for clip in found["clips"]] == sizes
    assert found["components"]["positions"] == sum(clip["components"]["positions"] for clip in found["clips"]) > 0
    assert found["reference_share"] == pytest.approx(sizes[0] / sum(sizes))
    assert found["mb_per_minute"] == pytest.approx(sizes[1] / 3 * found["fps"] * 60 / 1e6)
    code, out, _ = run("inspect", project)
    assert code == 0
    assert f"{found['mb_per_minute']:.1f} MB per minute" in out
    assert re.search(r"positions +\d", out)
    capture.rename(tmp_path / "elsewhere")
    assert json.loads(run("inspect", project, "--json")[1])["mb_per_minute"] is None
    assert "the capture is not there" in run("inspect", project)[1]


def test_inspecting_a_project_says_how_much_of_what_moves_is_within_reach_of_an_anchor(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert run("train", capture_folder, "--project", project, "--clip-length", 3)[0] == 0
    assert "within reach" not in run("inspect", project)[1]  # nothing known, as in files of earlier versions
    path = project / "clips" / "0001.safetensors"
    state = read_clip_state(path)
    coverage = {"n_points": 4000, "n_inherited": 500, "n_residual": 3000, "n_left_out": 500, "share": 0.9876}
    write_clip_state(path, ClipState(state.arrays, state.header | {"coverage": coverage | {"reason": "at most 3500"}}))
    clips = json.loads(run("inspect", project, "--json")[1])["clips"]
    assert [clip["coverage"] and clip["coverage"]["share"] for clip in clips] == [None, 0.9876]
    said = "clip 1 98.8 % with 3,000 anchors of its own, 500 points beyond the budget left to those beside them"
    assert said in run("inspect", project)[1]


def test_inspecting_a_project_without_clips_or_with_a_damaged_one_is_bad_input(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert run("train", capture_folder, "--project", project, "--clip-length", 3)[0] == 0
    clip = project / "clips" / "0001.safetensors"
    clip.write_bytes(clip.read_bytes()[:50])
    code, out, err = run("inspect", project)
    assert (code, out) == (2, "")
    assert "damaged" in err
    for path in (project / "clips").iterdir():
        path.unlink()
    code, out, err = run("inspect", project)
    assert (code, out) == (2, "")
    assert "Nothing is trained" in err


def test_help_and_nonsense(run):
    assert run("--help")[0] == 0
    code, _, err = run("frobnicate")
    assert code == 2
    assert "invalid choice" in err
    assert run("train")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "unknown"),
    [
        (["train", "c", "--project", "p", "--see", "3"], "--see 3"),  # an abbreviation is not taken for --seed
        (["eval", "p", "--json", "-", "--frames", "0:1"], "--frames 0:1"),
        (["bench", "extra"], "extra"),
    ],
)
def test_what_a_command_does_not_know_is_said_with_its_own_help(run, arguments, unknown):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert (
        err
        == f"clipgstream {arguments[0]}: unrecognized arguments: {unknown}. See `clipgstream {arguments[0]} --help`.\n"
    )


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["train", "c", "--project", "p"], "What was learned is kept; the same command goes on from there."),
        (["ablate", "c", "--project", "p"], "What was learned is kept; the same command goes on from there."),
        (["eval", "p", "--json", "-"], "Nothing was written."),
        (
            ["report", "p"],
            "The page was not written; projects that were measured to the end need not be measured again.",
        ),
        (["render", "p", "--camera", "0", "--out", "o"], "A video was not written; single pictures that were finished"),
        (["inspect", "p"], ""),
        (["bench"], ""),
    ],
)
def test_an_interrupted_command_says_what_has_become_of_its_work(run, monkeypatch, arguments, expected):
    def interrupted(options, launch):
        raise KeyboardInterrupt

    monkeypatch.setitem(cli._COMMANDS, arguments[0], interrupted)
    code, out, err = run(*arguments)
    assert (code, out) == (130, "")
    assert err.strip().startswith(f"clipgstream: Interrupted. {expected}".rstrip())
    assert ("kept" in err) == ("kept" in expected)


INTERRUPTED = """
import os, signal, sys
from functools import partial
from app.cli import main
from app.training.process import ProcessWorker
from tests.app.fakes import make_slow

class Interrupting(ProcessWorker):
    def poll(self):
        events = super().poll()
        if any(getattr(event, "step", 0) > 0 for event in events):
            os.kill(os.getpid(), getattr(signal, sys.argv[3]))
        return events

if __name__ == "__main__":
    # whatever started the tests in the background made its children ignore Ctrl+C; a terminal does not
    signal.signal(signal.SIGINT, signal.default_int_handler)
    launch = lambda job, project: Interrupting(job, project, make_slow)
    sys.exit(main(["train", sys.argv[1], "--project", sys.argv[2], "--quiet"], launch=launch))
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_interrupting_stops_cleanly_and_keeps_what_was_learned(tmp_path, capture_folder, name):
    assert hasattr(signal, name)
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    done = subprocess.run(
        [sys.executable, str(script), str(capture_folder), str(tmp_path / "p"), name],
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
    )
    assert done.returncode == 130, done.stderr
    assert "What was learned is kept" in done.stderr
    assert "Traceback" not in done.stderr
    assert read_clip_state(tmp_path / "p" / "checkpoints" / "0000.safetensors").header["step"] > 0
    open_project(tmp_path / "p").close()


def test_a_dead_worker_ends_with_1(capture_folder, tmp_path, capsys):
    from app.training.process import ProcessWorker

    code = main(
        ["train", str(capture_folder), "--project", str(tmp_path / "p"), "--quiet"],
        launch=lambda job, project: ProcessWorker(job, project, make_crashing),
    )
    err = capsys.readouterr().err
    assert code == 1
    assert "ended with code -9" in err
    assert "clip-0000.log" in err


# ---------------------------------------------------------------- parts


@pytest.mark.parametrize(
    ("text", "expected"),
    [(":", range(0, 7)), ("2:5", range(2, 5)), ("3", range(3, 4)), ("4:", range(4, 7)), (":2", range(2))],
)
def test_ranges(text, expected):
    assert parse_range(text, 7, option="--frames", what="frames") == expected


@pytest.mark.parametrize("text", ["", "a:b", "-1:3", "3:2", "0:8", "7", "1:2:3"])
def test_ranges_that_are_none(text):
    with pytest.raises(ProjectError, match="frames 0 to 6"):
        parse_range(text, 7, option="--frames", what="frames")


class Stream(io.StringIO):
    """Collects what is written; says whether it is a terminal."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__()
        self._is_terminal = is_terminal

    def isatty(self) -> bool:
        return self._is_terminal

    @property
    def text(self) -> str:
        return self.getvalue()


def test_a_terminal_gets_one_line_that_redraws_itself():
    stream, now = Stream(True), iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(now)))
    for share in (0.0, 0.5, 1.0):
        line.update("Training", share, "2:00 left")
    line.say("done")
    assert stream.text.count("\r") == 3
    assert stream.text.count("\n") == 2
    assert "[############............]  50 %" in stream.text


def test_elsewhere_there_are_plain_lines_not_too_many():
    stream = Stream(False)
    seconds = iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(seconds)))
    for i in range(30):
        line.update("Training", i / 30, "")
    assert "\r" not in stream.text
    assert stream.text.count("\n") == 3  # one per ten seconds


def test_quiet_writes_nothing():
    stream = Stream(True)
    line = ProgressLine(stream, is_quiet=True)
    line.update("Training", 0.5)
    line.say("done")
    line.finish()
    assert stream.text == ""


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [(0, "0:00"), (61.4, "1:01"), (3725, "1:02:05"), (None, "?"), (float("nan"), "?"), (1e9, "?")],
)
def test_durations(seconds, expected):
    assert duration_text(seconds) == expected


def test_a_video_holds_every_picture_and_odd_sizes_fit(tmp_path):
    import av

    images = [np.full((35, 47, 3), 20 * i, np.uint8) for i in range(5)]
    assert write_video(tmp_path / "v.mp4", iter(images), fps=25.0) == 5
    with av.open(str(tmp_path / "v.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert float(container.streams.video[0].average_rate or 0) == 25.0
    assert [frame.shape for frame in frames] == [(36, 48, 3)] * 5
    # H.264 in limited range with chroma at half size: grey comes back within a few levels
    assert max(abs(int(frame.mean()) - 20 * i) for i, frame in enumerate(frames)) <= 3


def test_a_video_that_fails_half_way_leaves_nothing(tmp_path):
    def images():
        yield np.zeros((16, 16, 3), np.uint8)
        raise ProjectError("The clip is damaged.")

    with pytest.raises(ProjectError, match="damaged"):
        write_video(tmp_path / "v.mp4", images(), fps=25.0)
    assert list(tmp_path.iterdir()) == []


def test_pictures_are_numbered_by_frame(tmp_path):
    assert write_pictures(tmp_path / "out", ((i, np.zeros((4, 4, 3), np.uint8)) for i in (7, 12))) == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["frame_000007.png", "frame_000012.png"]
