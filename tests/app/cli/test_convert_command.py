"""clipgstream convert: what it writes and says, and with which exit code."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.cli.cli import main
from tests.engine.capture.layouts import written_capture_json, written_colmap
from tests.engine.capture.layouts.scene import check_reads_as, make_scene


def test_it_writes_a_capture_that_opens(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = make_scene(lens="opencv5", names=("a b", "c.d", "ä"), n_frames=2)
    written_capture_json.write(tmp_path / "a capture", scene)
    out = tmp_path / "new one"
    assert main(["convert", str(tmp_path / "a capture"), "--to", "colmap", "--frames", "copy", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert "3 cameras, 2 frames in" in said.err
    check_reads_as(out, scene)


def test_a_folder_that_is_there_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written_colmap.write(tmp_path / "old", make_scene(lens="pinhole", n_frames=1), lens="pinhole")
    assert main(["convert", str(tmp_path / "old"), "--to", "transforms", "--out", str(tmp_path / "old")]) == 2
    assert "already taken" in capsys.readouterr().err


def test_what_is_left_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written_colmap.write(tmp_path / "old", make_scene(lens="pinhole", n_frames=1), lens="pinhole", frames="images")
    assert main(["convert", str(tmp_path / "old"), "--to", "transforms", "--out", str(tmp_path / "new")]) == 0
    assert "open the folder with --follow-links" in capsys.readouterr().err


@pytest.mark.parametrize("bad", [["--to", "stl"], ["--to", "colmap", "--frames", "some"], []])
def test_mistyped_options_are_refused(tmp_path: Path, bad: list[str]) -> None:
    assert main(["convert", str(tmp_path), "--out", str(tmp_path / "new"), *bad]) == 2
    assert not (tmp_path / "new").exists()
