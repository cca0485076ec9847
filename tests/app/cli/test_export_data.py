"""Figures and cameras on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli.cli import main
from tests.app.residuals.conftest import make_project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Two trained clips of three frames, four cameras."""
    return make_project(tmp_path)


def test_figures_and_cameras_are_written(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    csv, js = tmp_path / "m.csv", tmp_path / "m.json"
    command = ["export", str(project), "--quiet"]
    assert main([*command, "--format", "metrics-csv", "--out", str(csv), "--frames", "1:3"]) == 0
    assert len(csv.read_text().splitlines()) == 1 + 2 * 4
    assert main([*command, "--format", "metrics-json", "--out", str(js), "--json"]) == 0
    assert [clip["clip_index"] for clip in json.loads(js.read_text())["clips"]] == [0, 1]
    said = json.loads(capsys.readouterr().out)
    assert (said["format"], said["path"], said["n_bytes"]) == ("metrics-json", str(js), js.stat().st_size)
    assert main([*command, "--format", "cameras-colmap", "--out", str(tmp_path / "c")]) == 0
    assert (tmp_path / "c" / "sparse" / "0" / "cameras.txt").is_file()
    assert main([*command, "--format", "cameras-transforms", "--out", str(tmp_path / "t")]) == 0
    assert (tmp_path / "t" / "transforms.json").is_file()


@pytest.mark.parametrize("format_", ["metrics-csv", "cameras-colmap"])
def test_what_cannot_be_written_is_said(
    project: Path, tmp_path: Path, format_: str, capsys: pytest.CaptureFixture[str]
):
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "a").write_text("a")
    assert main(["export", str(project), "--format", format_, "--out", str(taken), "--quiet"]) != 0
    assert str(taken) in capsys.readouterr().err
    assert [path.name for path in taken.iterdir()] == ["a"]
