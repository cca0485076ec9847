"""clipgstream edit: the stack of edits on the command line, and what is wrong with its arguments."""

from __future__ import annotations

import io
import json
import math
import sys
from pathlib import Path

import pytest

from app.project.opening.project_access import open_project
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Box, Everything, Scope, Sphere
from tests.app.made_projects import make_project
from tests.app.residuals.conftest import make_project as make_trained

BALL = ("--sphere", 0, 0, 1, 2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project without a capture."""
    made = make_project(tmp_path / "p")
    made.close()
    return made.folder


def edits(folder: Path):
    return open_project(folder, is_writable=False).document.edits


@pytest.mark.parametrize(
    ("arguments", "action", "is_inverted"),
    [
        (("--delete",), Delete(), False),
        (("--hide", "--inverted"), Hide(), True),
        (("--isolate",), Hide(), True),
        (("--isolate", "--inverted"), Hide(), False),
        (("--move", 1, -2, 0.5), Transform(translation=(1, -2, 0.5), pivot=(0, 0, 1)), False),
        (("--quat", 0, 0, 1, 0, "--pivot", 1, 1, 1), Transform(quat=(0, 0, 1, 0), pivot=(1, 1, 1)), False),
        (("--scale", 2, "--move", 0, 0, -1), Transform((0, 0, -1), scale=2, pivot=(0, 0, 1)), False),
        (("--recolour", 1, 0, 0, 0.5, "--opacity", 0.25), Recolor((1, 0, 0), 0.5, opacity=0.25), False),
        (("--saturation", 0, "--gains", 1, 2, 3), Recolor(saturation=0, gains=(1, 2, 3)), False),
        (("--exposure", -0.5), Expose(-0.5), False),
        (("--hold", 12), Hold(12), False),
        (("--smooth", 2), Smooth(2), False),
    ],
)
def test_what_an_edit_does(run, folder, arguments, action, is_inverted):
    code, out, err = run("edit", folder, *arguments, *BALL)
    assert (code, err) == (0, "")
    (edit,) = edits(folder)
    assert (edit.action, edit.target, edit.is_inverted) == (action, Sphere((0, 0, 1), 2), is_inverted)
    assert out.startswith(f"{folder}: 1 edit\n    1  ")


def test_a_turn_about_an_axis(run, folder):
    assert run("edit", folder, "--rotate", 0, 3, 0, 90)[0] == 0
    (edit,) = edits(folder)
    assert isinstance(edit.action, Transform)
    assert edit.action.quat == pytest.approx((math.sqrt(0.5), 0, math.sqrt(0.5), 0))
    assert (edit.target, edit.action.pivot) == (Everything(), (0, 0, 0))


@pytest.mark.parametrize(
    ("arguments", "target"),
    [
        ((), Everything()),
        (("--everything",), Everything()),
        (("--box", 3, 0, 0, 1, 4, -6), Box((2, 2, -3), (1, 2, 3))),
        (("--turned-box", 1, 2, 3, 4, 5, 6, 0, 1, 0, 0), Box((1, 2, 3), (4, 5, 6), (0, 1, 0, 0))),
        (("--target", '{"type": "sphere", "center": [1, 2, 3], "radius": 4}'), Sphere((1, 2, 3), 4)),
    ],
)
def test_what_an_edit_acts_on(run, folder, arguments, target):
    assert run("edit", folder, "--hide", *arguments)[0] == 0
    assert edits(folder)[0].target == target


@pytest.mark.parametrize(
    ("arguments", "scope"),
    [
        ((), Scope()),
        (("--everywhere",), Scope()),
        (("--frame", 3), Scope(3, 4)),
        (("--frames", "2:5"), Scope(2, 5)),
        (("--frames", "2:"), Scope(2)),
        (("--from", 2), Scope(2)),
        (("--reference",), Scope(is_reference_only=True)),
        (("--from", 4, "--reference"), Scope(4, is_reference_only=True)),
    ],
)
def test_in_which_frames(run, folder, arguments, scope):
    assert run("edit", folder, "--hide", *arguments)[0] == 0
    assert edits(folder)[0].scope == scope


def test_the_frames_of_a_clip_are_those_of_the_capture(run, tmp_path):
    project = make_trained(tmp_path)
    assert run("edit", project, "--hide", "--clip", 1)[0] == 0
    assert edits(project)[0].scope == Scope(3, 6)
    code, _, err = run("edit", project, "--hide", "--clip", 2)
    assert (code, err) == (2, "clipgstream: There is no clip 2; clips are 0 to 1.\n")


def test_gaussians_are_picked_by_their_attributes(run, tmp_path):
    project = make_trained(tmp_path)
    code, out, _ = run("edit", project, "--delete", "--where", "clip=1", "--at", 4, "--inverted", "--clip", 1)
    assert (code, "all but 12 Gaussians of clip 1, frames 3-5" in out) == (0, True), out
    for arguments, message in (
        (("--where", "opacity<0"), "Nothing is selected in frame 0"),
        (("--where", "x<0"), "There is no attribute 'x'"),
        (("--at", 3), "--at is given without --where"),
        (("--where", "opacity>0", "--target", '{"type": "picked", "sets": []}'), "--where goes with a box"),
    ):
        code, _, err = run("edit", project, "--delete", *arguments)
        assert (code, message in err) == (2, True), err
    code, _, err = run("edit", project, "--apply-permanently", "--hide")
    assert (code, "--apply-permanently is given with what an edit does" in err) == (2, True)


def test_steps_are_taken_back_by_another_program_run(run, folder):
    for name in ("a", "b", "c"):
        run("edit", folder, "--hide", "--name", name)
    assert run("edit", folder, "--undo", 2)[0] == 0
    assert [edit.name for edit in edits(folder)] == ["a"]
    assert run("edit", folder, "--redo")[0] == 0
    assert [edit.name for edit in edits(folder)] == ["a", "b"]
    out = run("edit", folder, "--history")[1]
    assert out.splitlines()[-4:] == ["Steps: 2", "  a", "  b", "  c (undone)"]
    code, _, err = run("edit", folder, "--redo", 2)
    assert (code, "2 steps cannot be redone: there are 1" in err) == (2, True)


def test_the_stack_is_changed_and_steps_are_taken_back(run, folder):
    for name in ("a", "b", "c"):
        assert run("edit", folder, "--delete", *BALL, "--name", name)[0] == 0

    def names() -> str:
        return "".join(edit.name if edit.is_on else edit.name.upper() for edit in edits(folder))

    for arguments, expected in (
        (("--move-to", 3, 0), "cab"),
        (("--off", 1), "cAb"),
        (("--on", 1), "cab"),
        (("--remove", 2), "ca"),
        (("--rename", 3, "x"), "xa"),
        (("--replace", 3, "--name=-d"), "-da"),
        (("--replace", 1, "--exposure", 1, "--frame", 7), "-da"),
    ):
        assert run("edit", folder, *arguments)[0] == 0
        assert names() == expected
    changed = edits(folder)[1]
    assert (changed.action, changed.scope, changed.target) == (Expose(1), Scope(7, 8), Sphere((0, 0, 1), 2))


def test_entries_of_the_document_come_from_standard_input(run, folder, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"markers": [{"frame_index": 3, "text": "here"}], "labels": []}'))
    assert run("edit", folder, "--put", "-")[0] == 0
    document = open_project(folder, is_writable=False).document
    assert [(marker.frame_index, marker.text) for marker in document.markers] == [(3, "here")]


def test_everything_as_json(run, folder):
    run("edit", folder, "--delete", *BALL, "--frames", "3:9")
    code, out, err = run("edit", folder, "--json", "--history")
    found = json.loads(out)
    assert (code, err, found["schema"]) == (0, "", 1)
    assert found["edits"] == [
        {
            "edit_id": 1,
            "name": "",
            "title": "delete sphere of radius 2",
            "target": {"type": "sphere", "center": [0.0, 0.0, 1.0], "radius": 2.0},
            "action": {"type": "delete"},
            "scope": {"first": 3, "stop": 9, "is_reference_only": False},
            "is_inverted": False,
            "is_on": True,
            "acts": [],
            "note": "",
        }
    ]
    assert {"undo", "redo", "past", "future"} <= found.keys()
    code, out, _ = run("edit", folder, "--delete", "--target", json.dumps(found["edits"][0]["target"]))
    assert edits(folder)[1].target == Sphere((0, 0, 1), 2)


def test_a_name_is_shown_in_one_line(run, folder):
    assert (
        "a\\nb 100 %, frame 3 (off)"
        in [
            run("edit", folder, "--hide", "--frame", 3, "--name", "a\nb 100 %"),
            run("edit", folder, "--off", 1),
        ][1][1]
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--delete", "--hide"), "--hide and --delete are given together"),
        (("--move", 0, 0, 0, "--exposure", 1), "are given together"),
        (("--frame", 3), "No edit is given"),
        (("--name", "x"), "No edit is given"),
        (BALL, "No edit is given"),
        (("--delete", "--sphere", 0, 0, 0, 0), "--sphere is not valid: a sphere with the radius 0.0 is empty"),
        (("--delete", "--sphere", 0, 0, "nan", 1), "not finite"),
        (("--delete", "--box", 0, 0, 0, 1, 0, 1), "--box is not valid"),
        (("--delete", "--turned-box", 0, 0, 0, 1, 1, 1, 1, 1, 0, 0), "not a rotation"),
        (("--scale", 0), "--scale is not valid: a scale of 0 makes everything vanish"),
        (("--rotate", 0, 0, 0, 90), "--rotate is not valid: the axis"),
        (("--rotate", 0, 1, 0, 90, "--quat", 1, 0, 0, 0), "given together"),
        (("--exposure", 99), "--exposure is not valid: stops is 99.0; it has to be a number between -16 and 16"),
        (("--hold", -1), "--hold is not valid: frame_index is -1; it has to be a whole number between 0 and"),
        (("--hide", "--frame", -1), "frames are counted from 0"),
        (("--hide", "--frames", "5:5"), "holds no frame"),
        (("--hide", "--frames", "a:b"), "not a range A:B"),
        (("--hide", "--clip", 0), "capture"),
        (("--hide", "--name", "x" * 300), "has 300 characters, at most 200 are kept"),
        (("--off", 4), "There is no edit 4. The project has no edits."),
        (("--off", 4, "--hide"), "--off is given with what an edit does"),
        (("--move-to", 4, 0), "no edit 4"),
        (("--rename", "x", "y"), "not the number of an edit"),
        (("--undo",), "1 steps cannot be undone: there are 0."),
        (("--redo", 0), "0 steps cannot be redone"),
        (("--put", "{"), "--put is not JSON"),
        (("--put", "[]"), "not an object"),
        (("--put", '{"edit": []}'), "is not valid (it has an entry 'edit', which is not known)"),
        (("--hide", "--target", '{"type": "cone"}'), "--target is not valid"),
        (("--hide", "--target", "{"), "--target is not valid"),
    ],
)
def test_it_names_what_is_wrong_with_its_arguments(run, folder, arguments, message):
    before = (folder / "project.json").read_bytes()
    code, out, err = run("edit", folder, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("clipgstream: ")
    assert err.count("\n") == 1
    assert (folder / "project.json").read_bytes() == before


def test_what_is_open_elsewhere_is_listed_but_not_changed(run, folder):
    writer = open_project(folder)
    assert run("edit", folder)[0] == 0
    code, _, err = run("edit", folder, "--hide")
    assert (code, "Traceback" in err) == (2, False)
    writer.close()
    assert run("edit", folder / "nothing")[0] == 2


def test_where_an_edit_acts_is_said_before_it_is_made_and_in_the_list(run, tmp_path):
    trained = make_trained(tmp_path)
    code, out, err = run("edit", trained, "--where", "clip=1", "--at", 4, "--hide")
    assert (code, err.startswith("Note: Acts in frames 3-5 only: other clips have other Gaussians.")) == (0, True)
    assert out.splitlines()[1].endswith("of clip 1, frames 3-5 only")
    code, out, err = run("edit", trained, "--where", "motion=static", "--at", 4, "--hide", "--from", 9)
    assert (code, out) == (2, "")
    assert "The edit can never act (from 9 on): the selection exists in frames 0-5 only." in err
