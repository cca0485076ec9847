"""clipgstream export: its arguments, what it prints, and what is wrong with them."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path

import pytest

from app.cli import export_command
from tests.app.residuals.conftest import make_project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return make_project(tmp_path)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_frames_are_exported_and_measured(run, project: Path, tmp_path: Path):
    code, out, err = run("export", project, "--format", "ply", "--frames", "1:6", "--step", 2, "--out", tmp_path / "o")
    assert (code, out) == (0, "")
    assert names(tmp_path / "o") == ["p_0001.ply", "p_0003.ply", "p_0005.ply", "p_export.json"]
    assert "Coordinates: axes as in the capture, scale as in the capture." in err
    assert "p_0003.ply: 100.0 dB against the live picture" in err
    assert re.search(r"4 files, [1-9]\d* kB, in", err)


def test_a_clip_is_exported_and_printed_as_json(run, project: Path, tmp_path: Path):
    arguments = ("--format", "spz", "--clip", 1, "--axes", "rub", "--json", "--quiet", "--out", tmp_path / "o")
    code, out, err = run("export", project, *arguments)
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert (document["schema"], document["format"], document["n_files"]) == (1, "spz", 4)
    assert document["path"] == str(tmp_path / "o")
    assert document["psnr_db"] >= 38
    assert "y and z reversed" in document["lines"][0]
    assert names(tmp_path / "o") == ["p_0003.spz", "p_0004.spz", "p_0005.spz", "p_export.json"]


def test_edits_that_go_along_are_named(run, project: Path, tmp_path: Path):
    run("edit", project, "--delete", "--sphere", 0, 0, 0, 1)
    said = "1 edit is included: delete sphere of radius 1"
    export = ("export", project, "--format", "ply", "--frames", "1:2", "--out")
    render = ("render", project, "--turntable", "--frames", "1:2", "--size", "32x24", "--out")
    for name, command in (("export", export), ("render", render)):
        code, _, err = run(*command, tmp_path / name)
        assert (code, said in err) == (0, True)
        code, _, err = run(*command, tmp_path / f"{name} plain", "--without-edits")
        assert (code, "is included" in err) == (0, False)
    code, _, err = run("export", project, "--format", "metrics-csv", "--out", tmp_path / "figures.csv")
    assert (code, "is included" in err) == (0, False)


def test_every_nth_of_all_frames(run, project: Path, tmp_path: Path):
    assert run("export", project, "--format", "splat", "--step", 5, "--out", tmp_path / "o")[0] == 0
    assert names(tmp_path / "o") == ["p_0000.splat", "p_0005.splat", "p_export.json"]


def test_it_names_what_is_wrong_with_its_arguments(run, project: Path, tmp_path: Path):
    (tmp_path / "file").write_text("mine")
    (project / "clips" / "0001.safetensors").unlink()
    export = ("export", project, "--format", "ply", "--out", tmp_path / "o")
    for extra, expected in (
        (("--frames", "4:99"), "frames 0 to 5"),
        (("--frames", "0:6"), "Frame 3 lies in clip 1, which is not trained"),
        (("--clip", 1), "not trained"),
        (("--clip", 7), "There is no clip 7. The project has clips 0 to 1."),
        (("--step", 0), "--step is 0"),
        (("--scale", 0), "Scale is 0.0; it has to be a number between 0.000001 and 1000000"),
        (("--out", tmp_path / "file"), "already taken"),
        (("--out", tmp_path / "file" / "x"), "is a file"),
        (("--out", project), "inside the project"),
    ):
        code, out, err = run(*export, *extra)
        assert (code, out, expected in err) == (2, "", True), err
        assert err.splitlines()[-1].startswith("clipgstream: ")
        assert "Traceback" not in err
    assert not (tmp_path / "o").exists()
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    "extra",
    [
        *(("--format", "obj"), ("--part", "half"), ("--up", "up"), ("--down", "-y"), ("--axes", "xyz")),
        *(("--frames", "0:1", "--clip", "0"), ("--up", "z", "--down", "y")),
    ],
)
def test_words_that_it_does_not_know(run, project: Path, tmp_path: Path, extra):
    code, out, err = run("export", project, "--format", "ply", "--out", tmp_path / "o", *extra)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "clipgstream export: argument --" in err


@pytest.mark.parametrize(("option", "up"), [(("--up", "z"), [0, 0, 1]), (("--down", "y"), [0, -1, 0])])
def test_which_axis_is_up_or_down(run, project: Path, tmp_path: Path, option, up):
    assert run("export", project, "--format", "glb", "--frames", 2, "--out", tmp_path / "o", *option)[0] == 0
    document = json.loads((tmp_path / "o" / "p_export.json").read_text())
    assert document["up"] == pytest.approx(up, abs=1e-6)
    assert document["psnr_db"] > 50


def test_every_option_has_help():
    parser = argparse.ArgumentParser()
    export_command.add_arguments(parser)
    assert all(action.help for action in parser._actions)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("--format", "cameras-colmap", "--up", "z"), "--up"),
        (("--format", "cameras-transforms", "--frames", "0:2"), "--frames"),
        (("--format", "metrics-csv", "--scale", "2"), "--scale"),
        (("--format", "ply", "--data-folder"), "--data-folder"),
        (("--player", "x.html", "--part", "static"), "--part"),
        (("--player", "x.html"), "--out"),
    ],
)
def test_an_option_that_would_be_passed_over_is_an_error(run, project: Path, tmp_path: Path, arguments, name: str):
    code, _, err = run("export", project, *arguments, "--out", tmp_path / "o")
    assert code == 2
    assert f"{name} does not apply to" in err
    assert not (tmp_path / "o").exists()


def test_the_project_itself_is_no_place_for_an_export(run, project: Path):
    before = (project / "project.json").read_bytes()
    code, _, err = run("export", project, "--format", "metrics-json", "--out", project / "project.json")
    assert code == 2
    assert "inside the project" in err
    assert (project / "project.json").read_bytes() == before


def test_every_second_frame_is_of_those_that_are_trained(run, project: Path, tmp_path: Path):
    (project / "clips" / "0001.safetensors").unlink()
    code, _, _ = run("export", project, "--format", "ply", "--step", 2, "--out", tmp_path / "o")
    assert code == 0
    assert sorted(path.stem for path in (tmp_path / "o").glob("*.ply")) == ["p_0000", "p_0002"]
