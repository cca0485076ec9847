"""Changes of copies: what they make of a document, what they refuse, and that they are kept to the last digit."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from app.document.changes import copy_changes as change
from app.document.changes.object_changes import object_named
from app.document.project_document import ProjectDocument
from app.document.storing.document_patch import document_difference, document_with
from app.document.storing.plain_patch import PatchError
from app.document.storing.stored_document import document_of, plain_document
from engine.camera.path_presets import turntable
from engine.camera.rotations import matrices_of
from engine.editing.actions import Transform
from engine.editing.copies.object_copy import MAX_COPIES, ObjectCopy, OnObject, OnPath
from engine.editing.scene_object import SceneObject
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError
from tests.app.document.documents import EMPTY, as_bytes

PATH = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name="orbit")
OBJECTS = (SceneObject(1, "one"), SceneObject(2, "Two"))
BASE = replace(EMPTY, objects=OBJECTS, camera_paths=(PATH,))
TURN = (math.cos(0.25), 0.0, math.sin(0.25), 0.0)
COPY = ObjectCopy(0, "", 1, Transform((1.0, 0.0, 0.5), TURN, 2.0), shift_frames=3.0)


def test_new_copies_have_numbers_and_names_of_their_own() -> None:
    document = change.add_copies(BASE, [COPY, structs.replace(COPY, object_id=2, name="mine")])
    assert [(copy.copy_id, copy.name) for copy in document.copies] == [(1, "one copy 1"), (2, "mine")]
    document = change.add_copies(change.remove_copies(document, [1]), [COPY])
    assert [copy.copy_id for copy in document.copies] == [2, 3]
    assert BASE.copies == ()


def test_one_copy_changes_and_the_others_stay() -> None:
    document = change.add_copies(BASE, [COPY, COPY, COPY])
    other = structs.replace(document.copies[1], speed=2.0, carried_by=OnPath("orbit"))
    changed = change.change_copy(document, other)
    assert changed.copies == (document.copies[0], other, document.copies[2])
    off = change.switch_copies(changed, [1, 3], is_on=False)
    assert [copy.is_on for copy in off.copies] == [False, True, False]
    assert change.switch_copies(off, [1, 3], is_on=True) == changed


def test_steps_are_the_first_one_again_and_again() -> None:
    copies = change.stepped(COPY, 3, "row")
    for k, copy in enumerate(copies, 1):
        assert copy.transform.translation == (k * 1.0, 0.0, k * 0.5)
        assert copy.transform.scale == 2.0**k
        assert copy.shift_frames == 3.0 * k
        expected = np.linalg.matrix_power(matrices_of(np.array(TURN)), k)
        np.testing.assert_allclose(matrices_of(np.array(copy.transform.quat)), expected, atol=1e-12)
        assert copy.group == "row"
    assert change.stepped(COPY, 1, "row") == [COPY]


def test_a_crowd_fills_rows_and_leaves_the_place_of_the_object() -> None:
    copies = change.crowd(ObjectCopy(0, "", 1), 3, 2, (1.0, 0.0, 0.0), (0.0, 0.0, 2.0), 1.5, "crowd")
    places = [copy.transform.translation for copy in copies]
    assert places == [(1, 0, 0), (2, 0, 0), (0, 0, 2), (1, 0, 2), (2, 0, 2)]
    assert [copy.shift_frames for copy in copies] == [1.5, 3.0, 4.5, 6.0, 7.5]
    assert {copy.group for copy in copies} == {"crowd"}


def test_groups_have_names_that_no_others_have() -> None:
    assert change.group_name(BASE, "one") == "one group 1"
    document = change.add_copies(BASE, [structs.replace(COPY, group="one group 1")])
    assert change.group_name(document, "one") == "one group 2"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"object_id": 7}, "no object 7"),
        ({"carried_by": OnObject(1)}, "by itself"),
        ({"carried_by": OnObject(9)}, "object 9"),
        ({"carried_by": OnPath("gone")}, "no camera path called 'gone'"),
        ({"name": "x" * 201}, "201 characters"),
        ({"group": "\ud800"}, "not Unicode"),
    ],
)
def test_what_cannot_be_a_copy_is_refused_with_the_cause(values: dict[str, Any], expected: str) -> None:
    with pytest.raises(ProjectError, match=expected):
        change.add_copies(BASE, [structs.replace(COPY, **values)])
    document = change.add_copies(BASE, [COPY])
    with pytest.raises(ProjectError, match=expected):
        change.change_copy(document, structs.replace(COPY, **{"copy_id": 1, "name": "a", **values}))


def test_numbers_that_no_copy_has_are_refused() -> None:
    document = change.add_copies(BASE, [COPY])
    for attempt in (
        lambda: change.change_copy(document, structs.replace(COPY, copy_id=5)),
        lambda: change.remove_copies(document, [1, 5]),
        lambda: change.switch_copies(document, [5], is_on=False),
    ):
        with pytest.raises(ProjectError, match="no copy 5"):
            attempt()
    with pytest.raises(ProjectError, match="no object called 'three'"):
        object_named(BASE, "three")
    assert object_named(BASE, " two ") == OBJECTS[1]


@pytest.mark.parametrize("n", [0, -3])
def test_fewer_than_one_are_refused(n: int) -> None:
    with pytest.raises(ProjectError, match=f"{n} copies"):
        change.stepped(COPY, n)
    with pytest.raises(ProjectError, match="cannot be made"):
        change.crowd(COPY, n, 3, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, "")


def test_too_many_or_too_far_are_refused() -> None:
    full = change.add_copies(BASE, change.crowd(COPY, 77, 13, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, "all"))
    assert len(full.copies) == MAX_COPIES
    with pytest.raises(ProjectError, match=f"more than {MAX_COPIES}"):
        change.add_copies(full, [COPY])
    with pytest.raises(ProjectError, match="not valid"):
        change.stepped(COPY, 500)  # 2**500 times as large
    with pytest.raises(ProjectError, match="not valid"):
        change.crowd(COPY, 3, 1, (float("inf"), 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, "")


# ---------------------------------------------------------------- keeping


def random_document(rng: random.Random, before: ProjectDocument) -> ProjectDocument:
    kind, copies = rng.randrange(5), before.copies
    if kind < 2 or not copies:
        values = {
            "object_id": rng.choice((1, 2)),
            "transform": Transform((rng.random(), -0.0, rng.random()), TURN, rng.random() + 0.1),
            "shift_frames": rng.choice((0.0, -0.0, rng.uniform(-9, 9))),
            "speed": rng.choice((1.0, -2.5, 0.0)),
            "outside": rng.choice(("hold", "loop", "gone")),
            "carried_by": rng.choice((None, OnPath("orbit"))),
            "is_in_place": rng.random() < 0.5,
            "stop": rng.choice((None, 7)),
        }
        return change.add_copies(before, [structs.replace(COPY, **values)])
    chosen = rng.choice(copies)
    if kind == 2:
        return change.change_copy(before, structs.replace(chosen, anchor_frame=rng.random(), name=f"n {rng.random()}"))
    if kind == 3:
        return change.remove_copies(before, [chosen.copy_id])
    return change.switch_copies(before, [copy.copy_id for copy in copies if rng.random() < 0.5], is_on=False)


def test_documents_and_their_differences_come_back_to_the_last_digit() -> None:
    rng, before = random.Random(3), BASE
    for _ in range(80):
        after = random_document(rng, before)
        assert as_bytes(document_of(plain_document(after))) == as_bytes(after)
        forward, back = document_difference(before, after), document_difference(after, before)
        assert as_bytes(document_with(before, forward)) == as_bytes(after)
        assert as_bytes(document_with(after, back)) == as_bytes(before)
        assert forward.keys() <= {"copies"}
        before = after


def test_a_project_without_copies_of_an_earlier_version_opens() -> None:
    plain = plain_document(BASE)
    del plain["copies"]
    assert as_bytes(document_of(plain)) == as_bytes(BASE)


@pytest.mark.parametrize(
    "entry",
    [
        {"speed": "fast"},
        {"speed": 1e9},
        {"outside": "away"},
        {"transform": {"type": "hide"}},
        {"transform": {"type": "transform", "scale": 0.0}},
        {"carried_by": {"type": "wind"}},
        {"first": -1},
        {"first": 5, "stop": 5},
        {"name": ""},
        {"more": 1},
    ],
)
def test_odd_entries_are_refused(entry: dict[str, Any]) -> None:
    plain = plain_document(change.add_copies(BASE, [COPY]))
    plain["copies"] = [plain["copies"][0] | entry]
    with pytest.raises((EntryError, ProjectError)):
        document_of(plain)


def test_two_copies_of_one_number_are_refused() -> None:
    plain = plain_document(change.add_copies(BASE, [COPY]))
    plain["copies"] *= 2
    with pytest.raises(ProjectError, match="same number"):
        document_of(plain)
    with pytest.raises((ProjectError, PatchError)):
        document_with(BASE, {"copies": {"items": [{"is": plain["copies"][0]}, {"is": plain["copies"][0]}]}})
