"""clipgstream apply: what goes, what stays, and what it says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.project.opening.project_access import open_project
from engine.clip_files.clip_state import read_clip_state
from engine.editing.actions import Delete
from engine.editing.edit import Edit, Picked, PickedRows
from engine.editing.picks import pack_rows
from tests.app.residuals.conftest import make_project


def test_it_says_what_would_go_and_then_does_it(run, tmp_path: Path):
    folder = make_project(tmp_path)
    project = open_project(folder)
    header = read_clip_state(project.clip_path(0)).header
    picked = Picked((PickedRows(0, header.fingerprint, "static", pack_rows(np.arange(4))),))
    project.change(replace(project.document, edits=(Edit(1, "", picked, Delete()),)), "delete")
    project.close()
    code, out, _ = run("apply", folder, "--dry-run", "--json", "--quiet")
    assert code == 0
    assert json.loads(out) == {"schema": 1, "n_anchors": 8, "clips": [0, 1], "kept_edits": None}
    code, out, _ = run("apply", folder, "--json", "--quiet")
    assert code == 0
    assert json.loads(out) == {"schema": 1, "n_anchors": 8, "clips": [0, 1], "kept_edits": []}
    code, _, said = run("apply", folder, "--quiet")
    assert code != 0
    assert "Nothing to apply" in said
