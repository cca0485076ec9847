"""Copies of objects by a program: places in words, the middle of an object, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from app.export.scene_frames import SceneFrames
from app.scripting.scripted_project import ScriptedProject, open_scripted
from engine.editing.copies.object_copy import OnObject
from engine.editing.edit import Scope
from engine.editing.scene_object import ObjectInClip, SceneObject
from engine.errors import ProjectError
from tests.app.stored_project import copy_stored


@pytest.fixture
def project(tmp_path: Path) -> Iterator[ScriptedProject]:
    """A small real training; all that moves in its first clip is an object."""
    copy_stored(tmp_path / "p")
    with open_scripted(tmp_path / "p") as found:
        sets = found.select("motion=moving", frame_index=1).sets
        objects = (SceneObject(1, "one", clips=(ObjectInClip(0, 3, sets),)), SceneObject(2, "nowhere"))
        found.change(replace(found.document, objects=objects), "objects")
        yield found


def test_a_copy_is_turned_about_the_middle_of_the_object(project: ScriptedProject) -> None:
    (copy,) = project.duplicate_object("One", quat=(0.0, 0.0, 0.0, 1.0), anchor_frame=1.0)
    opened, without = project.open_trained(), replace(project.document, copies=())
    plain, found = SceneFrames(opened, edits=without.stack()), SceneFrames(opened)
    added = found.copied(1.0)
    assert added is not None
    n_plain = len(plain.gaussians(1.0))
    assert len(found.gaussians(1.0)) == n_plain + len(added)
    middle = np.median(added.means.numpy(), axis=0)
    np.testing.assert_allclose(copy.transform.pivot, middle, atol=1e-4)
    assert copy.transform.pivot != (0.0, 0.0, 0.0)


def test_values_come_from_the_scope_and_other_objects(project: ScriptedProject) -> None:
    (copy,) = project.duplicate_object("one", speed=0.5, scope=Scope(2, 5), on_object="nowhere", copy_name="slow")
    assert (copy.first, copy.stop, copy.anchor_frame, copy.name) == (2, 5, 2.0, "slow")
    assert copy.carried_by == OnObject(2)
    assert copy.transform.pivot == (0.0, 0.0, 0.0), "nothing is read where it is not turned"
    crowd = project.make_crowd("one", 2, 2, across=(1.0, 0.0, 0.0), along=(0.0, 1.0, 0.0), step_frames=2.0)
    assert [one.shift_frames for one in crowd] == [2.0, 4.0, 6.0]
    project.switch_copies("one group 1", is_on=False)
    assert [one.is_on for one in project.copies] == [True, False, False, False]
    n_steps = len(project.history.past)
    project.switch_copies("one group 1", is_on=False)
    project.replace_copy(project.copies[0])
    assert len(project.history.past) == n_steps, "nothing has changed"
    project.replace_copy(structs.replace(project.copies[0], speed=3.0))
    assert project.copies[0].speed == 3.0
    project.remove_copies([2, 3, 4])
    assert [one.copy_id for one in project.copies] == [1]
    assert project.undo() == "remove 3 copies"


def test_what_cannot_be_is_refused_and_changes_nothing(project: ScriptedProject) -> None:
    for attempt, expected in (
        (lambda: project.duplicate_object("two"), "no object called 'two'"),
        (lambda: project.duplicate_object("nowhere", scale=2.0), "is not there at frame 0"),
        (lambda: project.duplicate_object("one", speed=float("nan")), "speed nan"),
        (lambda: project.duplicate_object("one", scale=0.0, pivot=(0.0, 0.0, 0.0)), "scale of 0"),
        (lambda: project.duplicate_object("one", on_path="a", on_object="nowhere"), "by a path and by an object"),
        (lambda: project.remove_copies("one"), "no copy and no group"),
        (lambda: project.switch_copies([3], is_on=True), "no copy 3"),
    ):
        with pytest.raises(ProjectError, match=expected):
            attempt()
    assert project.copies == ()
