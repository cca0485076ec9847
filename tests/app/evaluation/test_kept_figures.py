"""`clipgstream eval` as a command: figures are kept as they are measured, and nothing else is measured again."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from app.cli.cli import main
from app.evaluation.evaluation import ClipMeasuring, evaluate_project
from app.evaluation.headless import open_trained
from app.evaluation.kept_figures import KeptFigures
from app.project.opening.project_access import open_project
from engine.metrics.clips.seams import PairRow
from engine.metrics.clips.summary import EvalRow
from engine.metrics.columns import COLUMNS
from engine.storage.json_files import checked_line
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import change_header, train

pytestmark = pytest.mark.slow  # left out by make check, as the file takes seconds as a whole

DEADLINE_S = 300.0
HEADER = {"camera_names": [], "near_plane": 0.1, "spacing": 0.2}


def make_project(folder: Path, *, n_cameras: int, size: tuple[int, int] = (48, 32)) -> Path:
    """Two clips of three frames that can be rendered."""
    capture = write_capture(folder / "ring", n_cameras=n_cameras, size=size)
    project = train(folder / "p", capture)
    for path in (project / "clips").iterdir():
        change_header(path, **HEADER)
    return project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return make_project(tmp_path, n_cameras=4)


def evaluate(project: Path, *arguments: str) -> dict[str, Any]:
    out = project.parent / "out.json"
    assert main(["eval", str(project), "--json", str(out), *arguments]) == 0
    return json.loads(out.read_text())


def lines_of(project: Path) -> list[bytes]:
    return [line for path in sorted((project / "evaluations").iterdir()) for line in path.read_bytes().splitlines()]


@pytest.fixture(scope="module")
def large(tmp_path_factory) -> tuple[Path, dict[str, Any]]:
    """A project of so many and so large pictures that eval takes seconds, so that a signal comes in the middle on any
    machine, and what an undisturbed one finds."""
    project = make_project(tmp_path_factory.mktemp("large"), n_cameras=20, size=(240, 160))
    found = evaluate(project, "--quiet")
    return project, found


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGTERM])  # SIGINT is ignored below a shell's "&"
def test_an_evaluation_that_was_killed_goes_on_and_ends_the_same(tmp_path, large, sent):
    project, undisturbed = large
    shutil.rmtree(project / "evaluations")
    command = [sys.executable, "-m", "ui.main", "eval", str(project), "--json", str(tmp_path / "out.json")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ)
    kept, until_s = project / "evaluations" / "0000-all-float.jsonl", time.monotonic() + DEADLINE_S
    while not kept.exists() or kept.read_bytes().count(b"\n") < 10:
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < until_s
        time.sleep(0.01)
    process.send_signal(sent)
    said = process.communicate(timeout=DEADLINE_S)[1]
    assert process.returncode == {signal.SIGKILL: -signal.SIGKILL, signal.SIGTERM: 130}[sent]
    n_kept = sum(b'"row"' in line for line in lines_of(project))
    assert 5 <= n_kept < 120
    if sent == signal.SIGTERM:
        assert f"Interrupted. {n_kept} of 120 pictures were measured and are kept; the same command resumes" in said
    assert not (tmp_path / "out.json").exists()
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, env=os.environ, timeout=DEADLINE_S, check=True)
    first = re.search(r"(\d+)/120", done.stderr)
    assert first is not None
    assert n_kept - 1 <= int(first[1]) <= n_kept  # a kill can cut off the line that is being written
    assert json.loads((tmp_path / "out.json").read_text()) == undisturbed


def test_the_same_figures_for_any_number_of_threads(project):
    opened = open_trained(open_project(project, is_writable=False))
    documents = []
    for n_threads in (1, 3):
        for path in (project / "evaluations").glob("*"):
            path.unlink()
        documents.append(
            evaluate_project(
                opened, clip_indices=[0, 1], on_progress=lambda *_: None, measuring=ClipMeasuring(n_threads)
            )
        )
    assert documents[0] == documents[1]


def test_figures_of_one_call_serve_others_of_fewer_clips(project):
    whole = evaluate(project, "--quiet")
    n_lines = len(lines_of(project))
    part = evaluate(project, "--clips", "1", "--quiet")
    assert part["rows"] == [row for row in whole["rows"] if row["clip_index"] == 1]
    assert part["seams"]["boundaries"] == []
    assert len(lines_of(project)) == n_lines


@pytest.mark.parametrize("cut", [b"{", b"", b"\xff\xfe\x00", b"[" * 5000])
def test_a_damaged_file_is_measured_again(project, capsys, cut):
    whole = evaluate(project, "--quiet")
    (project / "evaluations" / "0000-all-float.jsonl").write_bytes(cut + b"\n" + b"\n".join(lines_of(project)[1:]))
    assert evaluate(project) == whole
    said = capsys.readouterr().err
    assert not cut or "Kept figures are damaged and are measured again" in said
    assert evaluate(project) == whole
    assert "24/24" in capsys.readouterr().err


def test_a_bad_byte_costs_one_figure(project, capsys):
    whole = evaluate(project, "--quiet")
    path = project / "evaluations" / "0001-all-float.jsonl"
    path.write_bytes(path.read_bytes().replace(b'"psnr": ', b'"psnr": 1', 1))
    assert evaluate(project) == whole
    said = capsys.readouterr().err
    assert "1 kept figures are damaged and are measured again" in said
    assert "23/24" in said


def test_a_line_that_was_cut_off_spoils_no_other(project):
    whole = evaluate(project, "--quiet")
    path = project / "evaluations" / "0001-all-float.jsonl"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert evaluate(project, "--quiet") == whole
    n_lines = len(path.read_bytes().splitlines())
    assert evaluate(project, "--quiet") == whole
    assert len(path.read_bytes().splitlines()) == n_lines  # all of it is there now


def test_files_of_versions_that_kept_optical_flow_and_lpips_are_read(project, capsys):
    whole = evaluate(project, "--quiet")
    for path in (project / "evaluations").iterdir():
        header, *lines = (json.loads(line) for line in path.read_text().splitlines())
        header |= {"holdout": ["0"], "lpips": False}
        for line in lines:
            if "pair" in line:
                line["pair"]["tof"] = 0.5
            else:
                line["row"]["figures"] |= dict.fromkeys(("lpips", "lpips_fit", "lpips_unscaled"))
                line["row"]["missing"] |= {"lpips": "the package lpips is not installed"}
        entries = [{key: value for key, value in line.items() if key != "checksum"} for line in (header, *lines)]
        path.write_text("".join(map(checked_line, entries)))
    before = lines_of(project)
    assert evaluate(project) == whole
    assert "24/24" in capsys.readouterr().err
    assert lines_of(project) == before


def test_another_version_of_a_clip_or_of_its_reference_is_measured_again(project, capsys):
    evaluate(project, "--quiet")
    change_header(project / "clips" / "0001.safetensors", fingerprint="another")
    evaluate(project)
    assert "12/24" in capsys.readouterr().err
    change_header(project / "clips" / "0000.safetensors", near_plane=0.2)
    evaluate(project)
    assert "24/24" in capsys.readouterr().err  # the arrays are what counts


def test_a_project_that_cannot_be_written_to_is_measured_all_the_same(project, capsys):
    whole = evaluate(project, "--quiet")
    for path in (project / "evaluations").iterdir():
        path.unlink()
    (project / "evaluations").rmdir()
    (project / "evaluations").touch()  # as root, rights alone keep nobody from writing
    assert evaluate(project) == whole
    assert "Figures are not kept (" in capsys.readouterr().err


def test_a_full_disk_ends_keeping_and_not_measuring(tmp_path):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no device that is always full")
    said: list[str] = []
    kept = KeptFigures(tmp_path / "a.jsonl", {"clip": "x"}, None, said.append)
    row = EvalRow(0, 0, "a", False, dict.fromkeys(COLUMNS), {})
    with full.open("wb", buffering=0) as file, kept.writing():
        kept._file = file
        kept.add(row)
        kept.add(PairRow(1, 0, "a", False, False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert kept.rows == {("a", 0): row}
    assert not kept.is_writable
    assert len(said) == 1
    assert "No space left" in said[0]


def test_two_processes_that_measure_a_clip_keep_each_others_figures(tmp_path):
    path, rows = tmp_path / "a.jsonl", [EvalRow(0, k, "a", False, dict.fromkeys(COLUMNS), {}) for k in range(3)]
    one, other = (KeptFigures(path, {"clip": "x"}, None, pytest.fail) for _ in range(2))
    with one.writing():
        one.add(rows[0])
        with other.writing():
            other.add(rows[1])
        one.add(rows[2])
    assert KeptFigures(path, {"clip": "x"}, None, pytest.fail).rows == {("a", k): row for k, row in enumerate(rows)}
