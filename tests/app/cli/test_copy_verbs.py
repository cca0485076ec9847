"""clipgstream edit PROJECT duplicate, crowd and copies: what they make, and what is wrong with their arguments."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.history import Changed
from app.project.opening.project_access import open_project
from engine.camera.path_presets import turntable
from engine.editing.actions import Transform
from engine.editing.copies.object_copy import OnObject, OnPath
from engine.editing.edit import PickedRows
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from tests.app.made_projects import make_project

SETS = (PickedRows(0, "own", "moving", pack_rows(np.arange(3))),)
PATH = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name="orbit")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project without a capture, with two objects and a path."""
    made = make_project(tmp_path / "p")
    objects = (SceneObject(1, "one", clips=(ObjectInClip(4, 14, SETS),)), SceneObject(2, "two"))
    made.happen(Changed("objects", replace(made.document, objects=objects, camera_paths=(PATH,))))
    made.close()
    return made.folder


def copies(folder: Path):
    return open_project(folder, is_writable=False).document.copies


def test_one_copy_with_everything(run, folder):
    code, out, err = run(
        "edit", folder, "duplicate", "--object", "One", "--by", 1, -2, 0.5, "--rotate", 0, 0, 2, 90, "--scale", 2,
        "--pivot", 1, 1, 1, "--shift", -2.5, "--speed", 0.5, "--outside", "loop", "--in-place", "--name", "twin",
        "--attach-path", "orbit", "--group", "pair",
    )  # fmt: skip
    assert (code, err) == (0, "")
    (copy,) = copies(folder)
    assert copy.transform == Transform((1, -2, 0.5), copy.transform.quat, 2, (1, 1, 1))
    assert copy.transform.quat == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    assert (copy.shift_frames, copy.speed, copy.anchor_frame, copy.outside) == (-2.5, 0.5, 4.0, "loop")
    assert (copy.is_in_place, copy.name, copy.group, copy.carried_by) == (True, "twin", "pair", OnPath("orbit"))
    assert out.splitlines() == [
        f"{folder}: 1 copy",
        "    1  twin: of one, move, rotate and scale, 2.5 frames earlier, speed 0.5 from frame 4, in its place, "
        "on the path orbit, in pair",
    ]


def test_several_and_a_crowd(run, folder):
    assert run("edit", folder, "duplicate", "--object", "one", "--by", 1, 0, 0, "--shift", 5, "--times", 3)[0] == 0
    assert [(copy.transform.translation[0], copy.shift_frames) for copy in copies(folder)] == [(1, 5), (2, 10), (3, 15)]
    code, out, _ = run(
        "edit", folder, "crowd", "--object", "one", "--size", 2, 3, "--across", 2, 0, 0, "--along", 0, 0, 3,
        "--step", 1, "--attach-object", "two", "--json",
    )  # fmt: skip
    assert code == 0
    found = json.loads(out)
    assert (found["schema"], len(found["copies"]), found["undo"]) == (1, 8, "crowd of 5: one")
    assert found["copies"][-1]["transform"]["translation"] == [4, 0, 3]
    assert found["copies"][-1]["shift_frames"] == 5
    assert copies(folder)[-1].carried_by == OnObject(2)
    assert {copy.group for copy in copies(folder)} == {"one group 1", "one group 2"}


def test_copies_are_switched_and_removed_one_by_one_or_as_a_group(run, folder):
    run("edit", folder, "duplicate", "--object", "one", "--times", 3)
    run("edit", folder, "duplicate", "--object", "two", "--name", "alone")
    assert run("edit", folder, "copies", "--off", "one group 1")[0] == 0
    assert [copy.is_on for copy in copies(folder)] == [False, False, False, True]
    assert run("edit", folder, "copies", "--on", 2)[0] == 0
    assert [copy.is_on for copy in copies(folder)] == [False, True, False, True]
    assert run("edit", folder, "copies", "--remove", "alone")[1].startswith(
        f"{folder}: 3 copies\n    1  one copy 1: of one, in"
    )
    assert run("edit", folder, "--undo")[0] == 0
    assert len(copies(folder)) == 4
    assert run("edit", folder, "copies")[1].count("\n") == 5


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("duplicate",), "--object"),
        (("duplicate", "--object", "nobody"), "no object called 'nobody'"),
        (("duplicate", "--object", "one", "--speed", 1000), "speed 1000"),
        (("duplicate", "--object", "one", "--speed", "nan"), "--speed"),
        (("duplicate", "--object", "one", "--by", 1, 2), "--by"),
        (("duplicate", "--object", "one", "--by", 1, 2, "inf"), "--by"),
        (("duplicate", "--object", "one", "--scale", 0, "--pivot", 0, 0, 0), "scale"),
        (("duplicate", "--object", "one", "--rotate", 0, 0, 0, 90), "axis"),
        (("duplicate", "--object", "one", "--times", 0), "0 copies"),
        (("duplicate", "--object", "one", "--times", 1001), "1000"),
        (("duplicate", "--object", "one", "--outside", "away"), "--outside"),
        (("duplicate", "--object", "one", "--attach-path", "gone"), "no camera path called 'gone'"),
        (("duplicate", "--object", "one", "--attach-object", "one"), "itself"),
        (("duplicate", "--object", "one", "--attach-object", "two", "--attach-path", "orbit"), "not allowed"),
        (("duplicate", "--object", "one", "--delete"), "--delete"),
        (("crowd", "--object", "one"), "--size"),
        (("crowd", "--object", "one", "--size", 1, 1), "1 x 1"),
        (("crowd", "--object", "one", "--size", 100, 100), "100 x 100"),
        (("copies", "--remove", "7"), "no copy 7"),
        (("copies", "--remove", "nothing"), "called 'nothing'"),
        (("copies", "--on", "1", "--off", "1"), "not allowed"),
        (("multiply",), "multiply"),
    ],
)
def test_bad_input_is_one_line_and_code_2(run, folder, arguments, said):
    code, out, err = run("edit", folder, *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert copies(folder) == ()


def test_options_of_an_edit_are_not_ignored(run, folder):
    for arguments in (("--delete",), ("--undo", 1), ("--history",)):
        code, _, err = run("edit", folder, *arguments, "duplicate", "--object", "one")
        assert code == 2
        assert err.count("\n") == 1
    assert copies(folder) == ()
