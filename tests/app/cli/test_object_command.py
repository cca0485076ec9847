"""clipgstream object and the verbs of clipgstream edit, on a small trained project; and the same from a script."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from app.document.changes import object_changes
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.objects.object_masks import strokes_of
from app.objects.searching import living_seeds
from app.project.opening.project_access import open_project
from app.scripting.scripted_project import open_scripted
from engine.capture.pixels.excluded_pixels import painted_pixels
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import ObjectTarget, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed
from engine.errors import ProjectError
from tests.app.made_projects import make_project
from tests.app.residuals.conftest import make_project as make_trained

_DOCUMENT = ProjectDocument(ProjectSettings("capture", "fingerprint"))
BALL = ("--sphere", 0.5, 0.5, 0.5, 0.4)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return make_trained(tmp_path / "made")


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    made = make_project(tmp_path / "p")
    made.close()
    return made.folder


def document(folder: Path):
    return open_project(folder, is_writable=False).document


def test_the_whole_life_of_an_object(run, folder):
    code, out, err = run("object", folder, "add", "ball", "--at", 1, *BALL, "--quiet")
    assert (code, err) == (0, "")
    assert out.startswith(f"{folder}: 1 object\n    1  ball: ")
    (one,) = document(folder).objects
    assert [(clip.start, clip.stop, bool(clip.origin)) for clip in one.clips] == [(0, 3, True), (3, 6, True)]
    assert one.seeds[0].frame_index == 1
    assert run("object", folder, "train", "ball", "off", "--quiet")[0] == 0
    assert run("object", folder, "correct", "BALL", "--at", 4, *BALL, "--remove", "--quiet")[0] == 0
    assert run("object", folder, "rename", 1, "the ball")[0] == 0
    assert run("object", folder, "span", "the ball", "1:5")[0] == 0
    assert run("object", folder, "find", "the ball", "--quiet")[0] == 0
    (one,) = document(folder).objects
    assert (one.name, one.first, one.stop, one.is_trained, len(one.seeds)) == ("the ball", 1, 5, False, 2)
    code, out, _ = run("object", folder, "--json")
    (told,) = json.loads(out)["objects"]
    assert (told["name"], told["seeds"], told["unsearched"]) == ("the ball", [1, 4], [])
    assert run("edit", folder, "delete", "--object", "the ball", "--frames", "2:4")[0] == 0
    assert document(folder).edits[0].target == ObjectTarget(1)
    assert run("object", folder, "remove", "the ball")[0] == 0
    assert document(folder).objects == () == document(folder).edits
    for _ in range(7):
        assert run("edit", folder, "--undo")[0] == 0
    assert document(folder).objects == ()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("add", "ball", "--at", 1), "Nothing is selected."),
        (("add", "ball", *BALL), "The frame is missing."),
        (("add", "ball", "--at", 99, *BALL), "There is no frame 99"),
        (("add", "--at", 1, *BALL), "add needs a name."),
        (("add", "ball", "--at", 1, *BALL, "--remove"), "--remove is given with add."),
        (("find", "cat"), "There is no object called 'cat'. Objects are dog."),
        (("correct", "cat", "--at", 1, *BALL), "There is no object called 'cat'. Objects are dog."),
        (("remove", "7"), "There is no object called '7'. Objects are dog."),
        (("rename", "dog"), "rename needs a value."),
        (("rename", "dog", " "), "An object needs a name."),
        (("span", "dog", "6"), "out of range"),
        (("span", "dog", "5:5"), "span is '5:5', which is empty or out of range."),
        (("train", "dog", "perhaps"), "'perhaps' is neither on nor off."),
        (("list", "dog"), "list does not take 'dog'."),
        (("find", "dog", "--at", 1), "--at is given with find."),
    ],
)
def test_what_cannot_be_is_one_line_and_exit_code_2(run, folder, arguments, words):
    rows = PickedRows(0, "abc", "static", pack_rows(np.arange(3)))
    with open_scripted(folder) as project:
        project.change(object_changes.add_object(project.document, ObjectSeed(0, (rows,)), name="dog"), "make dog")
    before = document(folder)
    code, out, err = run("object", folder, *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert document(folder) == before


# ---------------------------------------------------------------- verbs


@pytest.mark.parametrize(
    ("arguments", "action", "is_inverted"),
    [
        (("delete",), Delete(), False),
        (("hide",), Hide(), False),
        (("isolate",), Hide(), True),
        (("move", "--by", 0, 0, -1.5), Transform((0, 0, -1.5), pivot=(0, 0, 1)), False),
        (("move", "--by", 0, 0, 1, "--scale", 2), Transform((0, 0, 1), scale=2, pivot=(0, 0, 1)), False),
        (("move", "--scale", 2), Transform(scale=2, pivot=(0, 0, 1)), False),
        (("recolour", "--tint", 1, 0, 0, 0.5), Recolor((1, 0, 0), 0.5), False),
        (("recolour", "--opacity", 0.25), Recolor(opacity=0.25), False),
        (("expose", "--by", -0.5), Expose(-0.5), False),
        (("hold", "--as-in", 12), Hold(12), False),
        (("smooth", "--over", 2), Smooth(2), False),
    ],
)
def test_a_verb_is_an_option(run, empty, arguments, action, is_inverted):
    code, _, err = run("edit", empty, *arguments, "--sphere", 0, 0, 1, 2, "--frames", "3:7")
    assert (code, err) == (0, "")
    (edit,) = document(empty).edits
    assert (edit.action, edit.target, edit.scope) == (action, Sphere((0, 0, 1), 2), Scope(3, 7))
    assert edit.is_inverted == is_inverted


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("move",), "The values of move are missing. Give --by, or --quat, --rotate, --scale, --pivot."),
        (("move", "--by", 1, 2), "--by has 2 values; move takes 3: X Y Z."),
        (("move", "--by", 1, 2, 3, "--move", 1, 2, 3), "--by and --move are given together."),
        (("hold", "--as-in", 1.5), "--as-in 1.5 is not a whole number."),
        (("smooth", "--by", 1), "--by does not go with smooth. It goes with move and expose."),
        (("--by", 1), "--by does not go with an edit without a verb."),
        (("delete", "--hide"), "are given together"),
        (("delete", "--undo"), "--undo is given with what an edit does."),
        (("delete", "--object", "cat"), "There is no object called 'cat'. The project has no objects."),
        (("paint",), "'paint' is not a verb. Verbs are hide, "),
        (("delete", "it"), "delete is followed by 'it', which is not an option of it."),
        (("trim", "--over", 2), "--over does not go with trim."),
        (("speed", "--by", 2, 3), "--by has 2 values; speed takes 1."),
    ],
)
def test_verbs_that_cannot_be(run, empty, arguments, words):
    code, out, err = run("edit", empty, *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert document(empty).edits == ()


# ---------------------------------------------------------------- scripts


def test_scripts_do_the_same(folder):
    told: list[float] = []
    with open_scripted(folder) as project:
        picked = project.select(frame_index=1, volume=Sphere((0.5, 0.5, 0.5), 0.4))
        one = project.make_object("ball", picked, 1, on_progress=told.append)
        assert (one.name, one.object_id, told[0]) == ("ball", 1, 0.0)
        edit = project.apply_edit(Delete(), project.object("ball"))
        assert edit.target == ObjectTarget(1) == project.object(1)
        assert project.find_object("ball").clips == one.clips
        assert len(project.history.past) == 2, "what was found is not a step"
        corrected = project.correct_object("ball", 4, removed=picked)
        assert len(corrected.seeds) == 2
        project.recolour_object("ball", (1.0, 0.0, 0.0))
        with pytest.raises(ProjectError, match="There is no object called 'cat'"):
            project.find_object("cat")
        with pytest.raises(KeyboardInterrupt):
            project.find_object("ball", on_progress=_interrupt)
        project.undo()
        project.undo()
        assert project.objects == (one,)
    with open_scripted(folder, read_only=True) as project:
        assert project.objects == (one,)
        with pytest.raises(ProjectError, match="read-only"):
            project.find_object("ball")


def test_an_object_is_measured_on_its_own(run, folder, tmp_path):
    with open_scripted(folder) as project:
        project.make_object("ball", project.select(frame_index=1), 1)
        found = project.measure_object("ball")
        assert found["clips"].keys() == {"0", "1"}
        of_clip = found["clips"]["0"]
        assert of_clip["held_out"]["pictures"] > 0
        assert 0.0 < of_clip["trained_on"]["psnr"] < 100.0
        assert project.measure_object("ball", clip_indices=[1])["clips"] == {"1": found["clips"]["1"]}
        project.set_object_span("ball", 5, 6)
        later = project.measure_object("ball")["clips"]
        assert later["0"]["held_out"] == {"psnr": None, "pictures": 0, "pixels": 0}
        assert later["1"]["trained_on"]["pictures"] <= 3
    out = tmp_path / "figures.json"
    code, _, err = run("eval", folder, "--json", out, "--metrics", "quick", "--object", "ball")
    assert code == 0
    assert "ball alone: PSNR" in err
    assert json.loads(out.read_text())["object"]["clips"] == later
    code, _, err = run("eval", folder, "--json", tmp_path / "no.json", "--object", "cat")
    assert (code, err.strip().endswith("Objects are ball.")) == (2, True)


def test_an_object_is_left_out_of_training_where_it_was_found(folder):
    with open_scripted(folder) as project:
        project.make_object("ball", project.select(frame_index=1), 1)
        project.set_object_trained("ball", is_trained=False)
        masks = project.document.exclusions.masks
        assert {(mask.first, mask.stop) for mask in masks} == {(0, 3), (3, 6)}
        assert {mask.object_id for mask in masks} == {1}
        assert project.history.undo_name == "train without ball"
        measured = project.measure_object("ball")["clips"]["0"]
        assert measured["trained_on"]["pixels"] == 0, "nothing of it is left to compare with"
        project.set_object_trained("ball", is_trained=True)
        assert project.document.exclusions.masks == ()
        project.set_object_span("ball", 100)
        with pytest.raises(ProjectError, match="ball was found in no clip"):
            project.set_object_trained("ball", is_trained=False)


def test_strokes_cover_a_mask_and_little_more():
    mask = np.zeros((60, 80), bool)
    rows, columns = np.mgrid[:60, :80]
    mask[(rows - 30) ** 2 + (columns - 40) ** 2 < 200] = True
    mask[3:5, 70:72] = True
    painted = painted_pixels(strokes_of(mask), 80, 60)
    assert painted[mask].all()
    assert painted.sum() < 2 * mask.sum()
    assert strokes_of(np.zeros((60, 80), bool)) == ()


def _interrupt(done: float) -> None:
    raise KeyboardInterrupt


def test_a_seed_whose_clip_was_trained_anew_is_replaced_by_what_was_found_next_to_it():
    def rows(origin: str) -> tuple[PickedRows, ...]:
        return (PickedRows(0, origin, "moving", pack_rows(np.arange(3))),)

    clips = tuple(
        ObjectInClip(10 * i, 10 * i + 10, rows(name), ((10 * i + 2, 10 * i + 9),), origin=name)
        for i, name in enumerate("abc")
    )
    made = object_changes.add_object(_DOCUMENT, ObjectSeed(4, rows("a"))).objects[0]
    one = structs.replace(made, clips=clips)
    origins = {0: "a", 10: "b", 20: "c"}
    assert living_seeds(one, origins, {*"abc"}) == one.seeds
    anew = origins | {0: "x"}
    assert living_seeds(one, anew, {*"xbc"}) == (ObjectSeed(12, rows("b")),)
    correction = ObjectSeed(22, removed=rows("c"))
    corrected = structs.replace(one, seeds=(*one.seeds, correction))
    assert living_seeds(corrected, anew, {*"xbc"}) == (ObjectSeed(12, rows("b")), correction)
    assert living_seeds(one, {0: "x", 10: "y", 20: "z"}, {*"xyz"}) == one.seeds
