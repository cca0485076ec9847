"""Regions of the gate: kept in the project, marked on the command line, and what the command says of trained clips."""

import json

import numpy as np
import pytest

from app.cli.cli import main
from app.document.project_settings import ProjectSettings
from app.project.opening.project_access import create_project
from engine.clip_files.clip_state import ClipState, write_clip_state
from engine.gate.reasons import STILL
from engine.gate.regions import GateRegion
from tests.app.fakes import anchor_arrays
from tests.clip_headers import make_header

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc")
BOX = GateRegion("static", (-1.0, 0.0, 0.0), (1.0, 2.0, 3.0))
LIGHT = 2
"""A code that clips of earlier versions hold: a lamp or a shadow."""
BALL = GateRegion("dynamic", (0.5, 0.5, 0.5), (1.5, 1.5, 1.5), radius=0.5)


@pytest.fixture
def folder(tmp_path):
    create_project(tmp_path / "p", SETTINGS).close()
    return tmp_path / "p"


def run(capsys, *arguments) -> tuple[int, str, str]:
    code = main([str(argument) for argument in ("gate", *arguments)])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_regions_are_marked_in_the_order_of_the_command_line(folder, capsys):
    code, out, _ = run(
        capsys, folder, "--static-box", -1, 2, 0, 1, 0, 3, "--dynamic-sphere", 1, 1, 1, 0.5, "--json"
    )  # corners may be given in any order
    assert code == 0
    assert json.loads(out)["regions"] == [BOX.as_dict(), BALL.as_dict()]
    code, out, _ = run(capsys, folder, "--static-sphere", 1, 1, 1, 2)
    assert code == 0
    assert out.count("marked: ") == 3
    assert "static in the box from (-1, 0, 0) to (1, 2, 3)" in out
    assert "dynamic in the sphere of 0.5 around (1, 1, 1)" in out
    code, out, _ = run(capsys, folder, "--forget", "--dynamic-box", 0, 0, 0, 1, 1, 1)
    assert out.count("marked: ") == 1
    assert run(capsys, folder, "--static-sphere", 1, 1, 1, -2)[0] == 2
    assert run(capsys, folder)[1].count("marked: ") == 1


def test_what_was_decided_is_counted_per_clip(folder, capsys):
    arrays = {
        **{name: array[:2] for name, array in anchor_arrays("replacing").items()},
        "inherited.static.is_hidden": np.array([True, False, True, False]),
        "gate.static": np.array([LIGHT, STILL, LIGHT, STILL], np.uint8),
    }
    header = make_header(role="source", clip_index=1, reference_fingerprint="clip")
    (folder / "clips").mkdir()
    write_clip_state(folder / "clips" / "0001.safetensors", ClipState(arrays, header))
    code, out, _ = run(capsys, folder)
    assert code == 0
    assert "source 1: 2 replacing anchors of its own; 2 inherited static anchors are replaced" in out
    assert "2  still" in out
    assert "2  lamp or shadow" in out
