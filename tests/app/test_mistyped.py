"""What was mistyped on the command line gets the nearest word; odd names reach no terminal and no spreadsheet."""

from __future__ import annotations

import csv
import io
import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.arguments import suggestion
from app.cli.cli import PrintableStream
from app.csv_text import csv_text
from app.project.opening.project_access import create_project, default_settings
from engine.capture.capture import open_capture
from ui import main as ui_main

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def opened(monkeypatch):
    """Paths that a window or the demo was opened with, instead of a window."""
    found: list[object] = []
    monkeypatch.setattr(ui_main, "_run_window", lambda options: found.append(options.path) or 0)
    monkeypatch.setattr(ui_main, "_run_demo", lambda options: found.append(options.path) or 0)
    monkeypatch.setattr(ui_main.logging, "basicConfig", lambda **options: None)
    monkeypatch.setattr(ui_main, "start_logging", lambda **options: None)
    return found


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["trian", "x"], "'trian' is neither a command nor a file or folder. Did you mean train? See"),
        (["Trian"], "Did you mean train?"),
        (["redner", "p", "--camera", "1"], "Did you mean render?"),
        (["dmeo"], "Did you mean demo?"),
        (["frobnicate", "x"], "'frobnicate' is neither a command nor a file or folder. See"),
    ],
)
def test_a_mistyped_command_suggests_the_nearest_one(opened, capsys, arguments, said):
    with pytest.raises(SystemExit) as caught:
        ui_main.main(arguments)
    assert caught.value.code == 2
    assert said in capsys.readouterr().err
    assert opened == []


@pytest.mark.parametrize("name", ["trian", "train.d", "folder/trian"])
def test_a_path_that_exists_opens_whatever_it_is_called(opened, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    Path(name).mkdir(parents=True)
    assert ui_main.main([name]) == 0
    assert opened == [Path(name)]


def test_a_path_that_is_no_word_is_left_to_the_window_to_name(opened):
    assert ui_main.main(["/nowhere/at/all"]) == 0
    assert opened == [Path("/nowhere/at/all")]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["train", "CAPTURE", "--project", "p", "--sede", "3"],
            "unrecognized arguments: --sede 3. Did you mean --seed?",
        ),
        (["render", "p", "--camera", "1", "--out", "o", "--frame", "1"], "Did you mean --frames?"),
        (["inspect", "CAPTURE", "--jsn"], "Did you mean --json?"),
        (
            ["inspect", "CAPTURE", "--frobnicate"],
            "unrecognized arguments: --frobnicate. See `clipgstream inspect --help`",
        ),
        (["train", "CAPTURE", "--project", "p", "--holdout", "camra"], "There is no camera 'camra'."),
    ],
)
def test_a_mistyped_option_suggests_the_nearest_one(run, capture_folder, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(*(str(capture_folder) if part == "CAPTURE" else part for part in arguments))
    assert code == 2
    assert said in err
    assert not (tmp_path / "p").exists()


def test_a_mistyped_camera_suggests_the_nearest_one():
    assert suggestion("cam3", ["cam03", "cam17"]) == " Did you mean cam03?"
    assert suggestion("CAM03", ["cam03", "cam17"]) == " Did you mean cam03?"
    assert suggestion("x", ["cam03"]) == ""


def test_frames_that_are_not_trained_are_told_with_those_that_are(run, capture_folder, tmp_path):
    settings = default_settings(open_capture(capture_folder), clip_length=2)
    create_project(tmp_path / "p", settings).close()
    assert run("train", capture_folder, "--project", tmp_path / "p", "--clips", "0:2", "--quiet")[0] == 0
    out = tmp_path / "x.mp4"
    code, _, err = run("render", tmp_path / "p", "--camera", "1", "--frames", "0:6", "--out", out)
    assert code == 2
    assert "Frame 4 lies in clip 2, which is not trained; of the 3 clips asked for 1 is not." in err
    assert "or take what is trained: --frames 0:4." in err
    assert not out.exists()


def test_names_reach_the_terminal_written_out():
    stream = io.StringIO()
    PrintableStream(stream).write("cam\x1b[31m \ud800\n")
    assert stream.getvalue() == "cam\\x1b[31m \\ud800\n"


@pytest.mark.slow
def test_a_camera_name_cannot_command_the_terminal(capture_folder, tmp_path):
    import shutil

    shutil.copytree(capture_folder, tmp_path / "c\x1b[31m\udcff")
    done = subprocess.run(
        [sys.executable, "-c", "from app.cli.cli import main; import sys; sys.exit(main(sys.argv[1:]))", "inspect",
         tmp_path / "c\x1b[31m\udcff"],
        cwd=ROOT, capture_output=True, check=False,
    )  # fmt: skip
    assert b"\x1b" not in done.stdout + done.stderr
    assert b"Traceback" not in done.stderr
    assert done.returncode in (0, 2)
    assert b"c\\x1b[31m" in done.stdout + done.stderr


def test_no_cell_of_a_table_is_a_formula():
    names = ["camera", "=sum"]
    odd = ["=HYPERLINK(1)", "+1+1", "-2+3", "@x", "\tx", "\rx", "plain", "-1.5", -1.5, None, "a=b", 'say "=1"']
    read = list(csv.reader(io.StringIO(csv_text(names, [{"camera": value, "=sum": 1} for value in odd]))))
    assert read[0] == ["camera", "'=sum"]
    assert [row[0] for row in read[1:]] == [
        *("'=HYPERLINK(1)", "'+1+1", "'-2+3", "'@x", "\\tx", "\\rx", "plain", "-1.5", "-1.5", "", "a=b", 'say "=1"'),
    ]
    with pytest.raises(ValueError, match="too many or too few"):
        csv_text(["a"], [{"b": 1}])
