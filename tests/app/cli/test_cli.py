"""The command line: exit codes and messages that commands share."""

from pathlib import Path

import pytest

from app.cli.commands import COMMANDS
from app.export.staging import check_target
from app.project.opening.project_access import read_settings
from engine.errors import ProjectError
from tests.app.fakes import write_capture


def test_a_folder_that_is_no_capture(run, tmp_path):
    (tmp_path / "holiday").mkdir()
    for command in (["inspect", tmp_path / "holiday"], ["train", tmp_path / "holiday", "--project", tmp_path / "p"]):
        code, _, err = run(*command)
        assert code == 2
        assert "not a capture" in err
        assert str(tmp_path / "holiday") in err
    assert not (tmp_path / "p").exists()


def test_a_fault_of_the_program_is_one_line_and_in_the_log(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr("app.cli.chosen_project.open_capture", lambda *_args, **_kwargs: 1 / 0)
    code, _, err = run("train", capture_folder, "--project", tmp_path / "p")
    assert code == 1
    assert err.count("\n") == 1
    assert "bug in the program" in err
    log = Path(err.rpartition("Details are in ")[2].strip().rstrip("."))
    assert "ZeroDivisionError" in log.read_text()


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


def test_a_damaged_clip_is_named_before_anything_is_written(run, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "engine.model.reading.load_clip_model", lambda state, reference, backend: state
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
        assert err.rstrip().endswith(f"or train clip 1 again. - {clip}")
    assert not list(tmp_path.glob("o.*"))
    assert not (tmp_path / "pictures").exists()


def test_results_that_cannot_be_written_are_refused_before_the_work(run, capture_folder, tmp_path):
    (tmp_path / "file").write_text("")
    for out, expected in ((tmp_path / "file" / "o.json", "is a file"), (tmp_path, "is a folder")):
        with pytest.raises(ProjectError, match=expected):
            check_target(out)
        code, _, err = run("eval", tmp_path / "p", "--json", out)
        assert (code, expected in err) == (2, True), err
    check_target(tmp_path / "new" / "deep" / "o.json")
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


def test_help_and_nonsense(run):
    assert run("--help")[0] == 0
    code, _, err = run("frobnicate")
    assert code == 2
    assert "invalid choice" in err
    assert run("train")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "unknown"),
    [
        (
            ["train", "c", "--project", "p", "--see", "3"],
            "--see 3. Did you mean --seed?",
        ),  # an abbreviation is not taken for --seed
        (["eval", "p", "--json", "-", "--frames", "0:1"], "--frames 0:1"),
        (["bench", "extra"], "extra"),
    ],
)
def test_what_a_command_does_not_know_is_said_with_its_own_help(run, arguments, unknown):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    end = "" if unknown.endswith("?") else "."
    command = arguments[0]
    assert err == f"clipgstream {command}: unrecognized arguments: {unknown}{end} See `clipgstream {command} --help`.\n"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["train", "c", "--project", "p"], "Progress is kept; the same command resumes from there."),
        (["ablate", "c", "--project", "p"], "Progress is kept; the same command resumes from there."),
        (["eval", "p", "--json", "-"], "The result was not written."),
        (["report", "p"], "The page was not written."),
        (["render", "p", "--camera", "0", "--out", "o"], "Nothing was written."),
        (["inspect", "p"], ""),
        (["bench"], ""),
    ],
)
def test_an_interrupted_command_says_what_has_become_of_its_work(run, monkeypatch, arguments, expected):
    def interrupted(options, launch):
        raise KeyboardInterrupt

    monkeypatch.setattr(COMMANDS[arguments[0]].load(), "run", interrupted)
    code, out, err = run(*arguments)
    assert (code, out) == (130, "")
    assert err.strip().startswith(f"clipgstream: Interrupted. {expected}".rstrip())
    assert ("kept" in err) == ("kept" in expected)
